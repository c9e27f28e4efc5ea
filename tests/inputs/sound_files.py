"""The realistic house of each supported format, by the title of its entry in prepare/formats.py. Effects: files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final, NamedTuple

N_TRIANGLES: Final = 300_000
_FEW_TRIANGLES: Final = 2_000
_NO_PICTURE: Final = b""

Write = Callable[[Path], Path]


class SoundFile(NamedTuple):
    """A writer of a format's house, and the number of doors and windows it lists."""

    write: Write  # folder -> the file to be read
    n_openings: int = 0  # 0 = unknown
    models: Callable[[Path], Path] | None = None  # the file -> the folder of its models


def sound_files(n_triangles: int = N_TRIANGLES) -> dict[str, SoundFile]:
    """Title of a format -> its house; meshes have about n_triangles if the format has meshes."""
    from pbrs_farm.export.export_homes import export_house
    from pbrs_farm.read.builtin.builtin_home import builtin_home
    from tests.inputs import (
        front3d_files,
        habitat_files,
        ifc_files,
        mjcf_files,
        obj_files,
        plan_files,
        robot_files,
        scenestate_files,
        usd_files,
    )

    plans = {
        "custom plan": plan_files.write_own,
        "Swiss Dwellings": plan_files.write_swiss,
        "ProcTHOR and Holodeck": plan_files.write_procthor,
        "SpatialLM": plan_files.write_spatial_lm,
        "RoomPlan": plan_files.write_room_plan,
        "CubiCasa5k": plan_files.write_cubicasa,
        "ZInD": plan_files.write_zind,
        "react-planner": plan_files.write_react_planner,
        "blueprint3d": plan_files.write_blueprint3d,
    }
    each = max(n_triangles // 20, 12)

    def write_gltf(folder: Path) -> Path:
        export_house(builtin_home(), folder / "home", "gltf")
        return next((folder / "home").glob("*.glb"))

    return {
        "glTF": SoundFile(write_gltf),
        "OBJ": SoundFile(obj_files.write_obj_home),
        "URDF and SDF": SoundFile(robot_files.write_sdf),
        "sceneState": SoundFile(
            lambda folder: scenestate_files.hssd_like(folder, triangles=each),
            scenestate_files.N_OPENINGS, lambda file: file.parent / "objects",
        ),
        "3D-FRONT": SoundFile(
            lambda folder: front3d_files.write_house(folder, n_triangles=n_triangles), 12
        ),
        "Habitat": SoundFile(
            lambda folder: habitat_files.habitat_scene(folder, n_triangles), habitat_files.N_OPENINGS
        ),
        "OpenUSD": SoundFile(lambda folder: usd_files.realistic_home(folder / "home.usda", n_triangles)),
        "MuJoCo": SoundFile(mjcf_files.write_model),
        "IFC": SoundFile(lambda folder: ifc_files.realistic_house(folder / "house.ifc", n_triangles)),
    } | {title: SoundFile(write, len(plan_files.HOLES)) for title, write in plans.items()}  # fmt: skip


def every_format() -> dict[str, Write]:
    """Title of every format of the table -> writer of a small house into a folder."""
    from tests.read import textured_sources

    def sweethome3d(folder: Path) -> Path:
        return Path(textured_sources.sweethome3d(folder, _NO_PICTURE).location)

    def suncg(folder: Path) -> Path:
        return Path(textured_sources.suncg(folder, _NO_PICTURE).location)

    small = {title: sound.write for title, sound in sound_files(_FEW_TRIANGLES).items()}
    return small | {"Sweet Home 3D": sweethome3d, "SUNCG": suncg}
