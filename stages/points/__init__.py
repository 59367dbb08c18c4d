"""Any shape -> point cloud: area-weighted uniform and farthest-point samples with normals and part labels."""
