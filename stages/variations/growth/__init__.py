"""Growth: shapes are docked part by part from the exemplars' local patterns, by constraint propagation."""
