"""Verification of a finished dataset: files, every sample, and some samples by independent means."""
