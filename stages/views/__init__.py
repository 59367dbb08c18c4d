"""Stage `views`: any shape as rendered images: colour, depth, normals, instances, classes, masks."""
