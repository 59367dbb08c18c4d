"""Stage `sketches`: any shape as line drawings."""
