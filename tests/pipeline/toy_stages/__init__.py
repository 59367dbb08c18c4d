"""Four small stages of a pipeline that fail in every way when their config asks for it."""
