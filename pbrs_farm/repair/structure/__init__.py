"""Walls, floors and ceilings as watertight solids, openings cut; no effects."""
