"""Rooms of a plan -> the furniture that stands in them; pure in (plan, Catalogue, seed)."""
