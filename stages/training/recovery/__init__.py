"""Recovery: point clouds and drawings back to the parameters of a program (geocode §3.3)."""
