"""A recurrent network that writes the cuboids of a shape one after another, as 3D-PRNN does (Zou and others 2017)."""
