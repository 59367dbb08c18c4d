"""The programs that come with Shapemill: one file each, and files with their pieces."""
