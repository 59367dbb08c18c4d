"""Looking at shapes: cameras, buffers of what is visible, strokes and portraits. No stage of its own."""
