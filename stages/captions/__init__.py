"""Stage `captions`: each shape in words, short to long, of facts that hold for it."""
