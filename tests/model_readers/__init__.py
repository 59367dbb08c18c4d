"""Differential test of the model readers: on public models they read what another library reads."""
