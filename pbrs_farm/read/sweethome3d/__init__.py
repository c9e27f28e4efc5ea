"""Sweet Home 3D homes (.sh3d archives and bare Home.xml) -> House; no effects."""

from __future__ import annotations

from pbrs_farm.read.sweethome3d.home import read_home

__all__ = ["read_home"]
