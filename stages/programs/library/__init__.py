"""The programs that come with Shapemill, one file each, and the pieces of each beside it."""
