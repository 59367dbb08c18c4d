"""Operators that make a variant; the first three cut a piece for exchange."""

GROWN_CUT, PLANE_CUT, JOINT_CUT, SUBSTITUTION, GROWTH, REPLACEMENT, REPEATED_UNIT = range(7)
"""A piece grown part by part, cut by planes, or ended at joints; parts of a label substituted; a shape grown; a piece
replaced by an equivalent one; a repeated unit of a row inserted or removed."""
