"""Point clouds as surfaces: planar patches on a voxel grid, and the ridges where they meet."""
