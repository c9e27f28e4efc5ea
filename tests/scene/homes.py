"""A small home under a small recipe, and models to place in it."""

from __future__ import annotations

from pathlib import Path

import trimesh

import pbrs_farm as pf

SMALL = {
    "image.width_px": 64,
    "image.height_px": 48,
    "light.spp": 2,
    "light.pilot_spp": 0,
    "cameras.cell_m": 1.0,
    "cameras.score_width_px": 160,
    "cameras.score_height_px": 120,
}


def small_home() -> pf.Home:
    """The built-in home, small pictures."""
    return pf.load("builtin", recipe="preview", **SMALL)


def can(folder: Path) -> pf.Model:
    """A red cylinder 66 mm wide and 122 mm high, in millimetres, z up."""
    mesh = trimesh.creation.cylinder(radius=33, height=122, sections=24)
    mesh.visual.vertex_colors = [200, 30, 30, 255]
    mesh.export(folder / "can.ply")
    return pf.model(folder / "can.ply", category="bottle", unit="mm")


def crate(folder: Path) -> pf.Model:
    """A box of 12 x 20 x 6 cm, in metres, y up."""
    trimesh.creation.box((0.12, 0.2, 0.06)).export(folder / "crate.glb")
    return pf.model(folder / "crate.glb", category="box")
