"""Procedural surfaces that repeat without a seam: wood, tiles, brick, cloth, paper; pure numpy."""
