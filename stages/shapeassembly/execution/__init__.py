"""Execution: programs to cuboids, fast and differentiable."""
