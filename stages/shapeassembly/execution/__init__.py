"""Execution:_programs_to_cuboids,_fast_and_differentiable."""
