"""A producer in a project of its own: heaps of boxes, each sample a text that lists their heights."""
