"""A producer in a house of its own: heaps of boxes, each sample a text that lists their heights."""
