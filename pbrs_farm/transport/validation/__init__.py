"""Validation of light transport: rooms of known radiance, statistics, claims of `verify --light`."""
