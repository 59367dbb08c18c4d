"""Shape graphs to many valid new assemblies by exchange of subgraphs with matching boundaries (strings §4)."""
