"""Recovery: the parameters of a program from a scan, a mesh or a drawing (geocode §3.3, §4.4)."""
