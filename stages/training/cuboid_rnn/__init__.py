"""A recurrent network of cuboids, a baseline (3D-PRNN)."""
