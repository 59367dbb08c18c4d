"""Metrics as pure functions, and one table for each question."""
