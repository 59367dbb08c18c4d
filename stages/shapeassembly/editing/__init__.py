"""Program edits: continuous changes and language ablations."""
