"""Cameras that move: walks, what lies between views, how fast frames are made."""
