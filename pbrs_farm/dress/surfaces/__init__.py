"""Floors, walls, ceilings and skirting boards of every room, by its use and the home's style."""
