"""A network that embeds the points of clouds so that points of one part lie close together."""
