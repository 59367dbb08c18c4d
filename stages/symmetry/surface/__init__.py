"""A surface on a sparse voxel grid: its triangles, planes, boundary lines and corners."""
