"""Floors, walls, ceilings and skirting boards of every room, by its use and the home's style."""

from pbrs_farm.dress.surfaces.dress_surfaces import dress_surfaces

__all__ = ["dress_surfaces"]
