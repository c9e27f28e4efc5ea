"""A case, and ways to inspect the result of reading its file. Effects: processes, if a command is run."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import pbrs_farm as pf
from pbrs_farm.core.house import House, Item, Material
from pbrs_farm.core.recipe import ReadFields, recipe_from_name
from pbrs_farm.prepare.finished_house import repaired_house
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from pbrs_farm.repair.repair_report import RepairReport
from pbrs_farm.views.views import Frame
from tests.hostile.case import ONE_VIEW
from tests.hostile.process_tree import watch

Rgb = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Case:
    """A file once read wrongly. write: writes it into a folder and returns the path to name.

    ask: raises AssertionError, or any other error, if the result is wrong.
    """

    name: str
    write: Callable[[Path], Path]
    ask: Callable[[Path], None]


def house_of(path: Path) -> House:
    """The house as read."""
    return read_house(resolve(str(path)), ReadFields())


def repaired(path: Path) -> tuple[House, RepairReport]:
    """The house as rendered, and the report of its repair."""
    return repaired_house(resolve(str(path)), recipe_from_name("preview"))


def run(path: Path, out: Path) -> None:
    """Run the file with the command; AssertionError if it gives no picture."""
    ended = watch(("run", str(path), "--out", str(out), *ONE_VIEW), limit_s=180.0)
    assert ended.code == 0, ended.text[-500:]
    assert list(out.glob("houses/*/views/*/opengl_dl.png")), "no picture"


def shown(path: Path, eye: Rgb, target: Rgb, *, layers: tuple[str, ...] = ()) -> Frame:
    """A small picture of the home from one place to another."""
    camera = pf.Camera.look_at(eye, target, size=(160, 120), hfov_deg=75)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return pf.render(pf.load(str(path)), camera, modes=["opengl_dl"], layers=layers)


def depth_to(frame: Frame, eye: Rgb, point: Rgb) -> tuple[float, float]:
    """Depth at the pixel of a point, and the depth of the point itself, metres."""
    in_camera = np.linalg.inv(frame.world_from_camera_opencv) @ [*point, 1.0]
    u, v, w = frame.k @ in_camera[:3]
    return float(frame.depth[int(v / w), int(u / w)]), float(in_camera[2])


def named(house: House, name: str) -> Item:
    """The item of that name; AssertionError if it is missing."""
    matches = [i for i in house.items if i.name == name]
    assert matches, f"no {name!r} among {sorted(i.name for i in house.items)}"
    return matches[0]


def material_of(house: House, name: str) -> Material:
    """The material of the item's first surface."""
    return house.materials[named(house, name).surfaces[0].material]


def kinds_of_notes(house: House) -> set[str]:
    """The kinds of the house's notes."""
    return {note.kind for note in house.notes}
