"""Shape graphs to shapes: parts with poses whose contacts are the edges of a graph (strings §6)."""
