"""Readers: bytes of a home, a scene or a model -> House, a folder per format."""
