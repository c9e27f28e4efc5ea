"""What a view costs: cameras, OpenGL, labels, the whole of it."""
