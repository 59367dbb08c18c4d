"""Shapes of simple solids without a meaning: heaps, stacks, and solids attached to solids."""
