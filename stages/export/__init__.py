"""Finished samples as files of other tools: URDF, MJCF and OpenUSD for simulators, OBJ for modelling programs."""
