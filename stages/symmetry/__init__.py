"""From one mesh without parts to repeated pieces, by its partial symmetries (symmetry)."""
