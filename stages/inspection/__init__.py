"""`make inspect`: what models hold, which settings auto-configuration resolves for them, and what a run will find."""
