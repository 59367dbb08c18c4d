"""The way of the data: one folder a stage, in the order exemplars, variations, strings, points, sketches, package."""
