"""From a surface to its shape grammar: docking sites, docked pieces, productions and grids."""
