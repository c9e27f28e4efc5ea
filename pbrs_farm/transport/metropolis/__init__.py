"""Metropolis light transport over the camera path."""
