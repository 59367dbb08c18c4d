"""A VAE of part graphs, a baseline (StructureNet, Mo et al. 2019): boxes within boxes, edges where they touch."""
