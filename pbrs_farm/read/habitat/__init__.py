"""Habitat: how it is read."""
