"""Furnish the rooms of a plan; pure in (plan, Catalogue, seed)."""
