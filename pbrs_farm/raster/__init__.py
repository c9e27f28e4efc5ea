"""OpenGL pictures of a house: OpenGL-DL and OpenGL-IL; the only package that imports moderngl."""

from pbrs_farm.raster.rasterizer import Rasterizer

__all__ = ["Rasterizer"]
