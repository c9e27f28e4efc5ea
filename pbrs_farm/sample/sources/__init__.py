"""Sources of cameras: each module ends with its entry, and imports its implementation when called."""
