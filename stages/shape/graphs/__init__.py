"""Shape graphs: canonical form, colour refinement, neighbourhoods."""
