"""Cameras that move: a person's walk through a home, and a user's trajectory; no effects."""
