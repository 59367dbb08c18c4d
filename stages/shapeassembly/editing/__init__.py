"""Program_edits:_continuous_changes_and_language_ablations."""
