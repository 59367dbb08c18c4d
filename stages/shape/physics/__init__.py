"""Does a shape stand? Rootedness, static stability and structure from geometry alone, of any shape; no stage."""
