"""The vocabulary that flows between stages: Kit, PartType, Assembly, Sample, poses, and the one contact test."""
