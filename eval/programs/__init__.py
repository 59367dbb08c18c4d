"""Metrics about models of ShapeAssembly programs."""
