"""Laser scans: one turn of a scanner at each view's eye, as PLY and as PCD.

    <house>/<view>.ply  <house>/<view>.pcd  <house>/poses.txt

Effects: reads views and their house.glb, writes files. The scanner is upright at the camera's eye and
faces the camera's direction; a walk has a scan a frame. truth/lidar.py computes the beams.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.options import option
from pbrs_farm.core.record import Record
from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.export_homes import stored_house
from pbrs_farm.export.form import Convention, ViewForm
from pbrs_farm.export.sequences import pose_opencv
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.run.house_cache import decoded_textures
from pbrs_farm.truth.lidar import LIDARS, LidarScan, LidarSensor, lidar_scan

# fields of a return: name in PLY, name in PCD, type
# fmt: off
_FIELDS: Final = (
    ("x", "x", "<f4"), ("y", "y", "<f4"), ("z", "z", "<f4"), ("intensity", "intensity", "<f4"),
    ("range", "range", "<f4"), ("range_true", "range_true", "<f4"),
    ("nx", "normal_x", "<f4"), ("ny", "normal_y", "<f4"), ("nz", "normal_z", "<f4"),
    ("ring", "ring", "<u2"), ("label", "label", "<u2"), ("instance", "instance", "<u2"),
    ("via", "via", "<u2"), ("through", "through", "u1"), ("mirrored", "mirrored", "u1"),
)
# fmt: on
_PLY_TYPES: Final = {"<f4": "float", "<u2": "ushort", "u1": "uchar"}
_PCD_TYPES: Final = {"<f4": ("4", "F"), "<u2": ("2", "U"), "u1": ("1", "U")}


class LidarOptions(Record):
    """The options of the form."""

    scanner: str = option("vlp16", "the scanner (default vlp16)", choices=tuple(LIDARS))


def write_lidar(views: list[ChosenView], out: Path, choice: Choice) -> None:
    """Write the files above, a scan of each view.

    Points are in the scanner's axes, metres: x forward, y left, z up. poses.txt has rows
    `time x y z qx qy qz qw`, world from scanner (the home's world, y up). The time is a frame's in
    seconds, else the view's number; PCD repeats the pose as VIEWPOINT. A rig is scanned from its first
    camera alone.
    """
    scanner = choice.of(LidarOptions).scanner
    first_views = [view for view in views if not view.shot.eye]
    for house_id in dict.fromkeys(view.house.id for view in first_views):
        house_views = [view for view in first_views if view.house.id == house_id]
        _write_scans(out / house_id, house_views, scanner)


def _write_scans(folder: Path, views: list[ChosenView], scanner: str) -> None:
    sensor = LIDARS[scanner]
    house = stored_house(views[0].entry.folder.parent.parent)
    caster, (textures, _unread) = Caster.of_house(house), decoded_textures(house)
    folder.mkdir(parents=True)
    rows = []
    for number, view in enumerate(views):
        pose = scanner_pose(view)
        seed = keys.seed(house.id, view.id, "lidar", scanner)
        scan = lidar_scan(caster, house, pose, sensor, textures, seed=seed)
        records = _records(scan)
        quaternion = Rotation.from_matrix(pose[:3, :3]).as_quat(canonical=True)
        words = [f"{v:.9g}" for v in (*pose[:3, 3], *quaternion)]
        (folder / f"{view.id}.ply").write_bytes(_ply(records, view, sensor))
        (folder / f"{view.id}.pcd").write_bytes(_pcd(records, words))
        time = view.facts.get("time_s")
        rows.append(f"{number if time is None else time:.6f} {' '.join(words)}\n")
    (folder / "poses.txt").write_text("".join(rows), "utf-8")


def scanner_pose(view: ChosenView) -> F64:
    """(4, 4) world from scanner: at the view's eye, upright, forward in the camera's direction.

    Of a camera that looks straight up or down, the picture's up is forward.
    """
    camera = pose_opencv(view)
    ahead = camera[:3, 2] * [1, 0, 1]
    if np.linalg.norm(ahead) < 1e-6:
        ahead = -camera[:3, 1] * [1, 0, 1]
    ahead = ahead / np.linalg.norm(ahead)
    up = np.array([0.0, 1.0, 0.0])
    pose = np.eye(4)
    pose[:3, :3] = np.stack([ahead, np.cross(up, ahead), up], axis=1)
    pose[:3, 3] = camera[:3, 3]
    return pose


def _records(scan: LidarScan) -> NDArray[Any]:
    """(N,) records of the returns, by PLY's names."""
    columns: dict[str, NDArray[Any]] = {
        **dict(zip("xyz", scan.points.T, strict=True)),
        "intensity": scan.intensity,
        "range": scan.range_m,
        "range_true": scan.true_range_m,
        **dict(zip(("nx", "ny", "nz"), scan.normals.T, strict=True)),
        "ring": scan.ring,
        "label": scan.label,
        "instance": scan.instance,
        "via": scan.via,
        "through": scan.through,
        "mirrored": scan.mirrored,
    }
    records = np.empty(len(scan.ring), [(name, kind) for name, _pcd, kind in _FIELDS])
    for name, values in columns.items():
        records[name] = values
    return records


def _ply(records: NDArray[Any], view: ChosenView, sensor: LidarSensor) -> bytes:
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        f"comment {view.house.id}/{view.id}, {sensor.title}: {len(records)} of {sensor.n_beams} beams",
        "comment metres, x forward, y left, z up",
        *([f"comment {view.house.attribution}"] if view.house.attribution else []),
        f"element vertex {len(records)}",
        *(f"property {_PLY_TYPES[kind]} {name}" for name, _pcd, kind in _FIELDS),
        "end_header",
    ]
    return "".join(f"{line}\n" for line in lines).encode("utf-8") + records.tobytes()


def _pcd(records: NDArray[Any], words: Iterable[str]) -> bytes:
    x, y, z, qx, qy, qz, qw = words
    sizes, kinds = zip(*(_PCD_TYPES[kind] for _name, _pcd, kind in _FIELDS), strict=True)
    lines = [
        "# .PCD v0.7 - Point Cloud Data file format",
        "VERSION 0.7",
        f"FIELDS {' '.join(name for _ply, name, _kind in _FIELDS)}",
        f"SIZE {' '.join(sizes)}",
        f"TYPE {' '.join(kinds)}",
        f"COUNT {' '.join('1' for _ in _FIELDS)}",
        f"WIDTH {len(records)}",
        "HEIGHT 1",
        f"VIEWPOINT {x} {y} {z} {qw} {qx} {qy} {qz}",
        f"POINTS {len(records)}",
        "DATA binary",
    ]
    return "".join(f"{line}\n" for line in lines).encode() + records.tobytes()


def scanners_table() -> str:
    """The Markdown table of scanners in docs/howto/sensors.md."""
    rows = [
        "| scanner | rings, degrees | beams a ring | range in m | noise |",
        "|---|---|---|---|---|",
    ]
    for name, s in LIDARS.items():
        low, high = s.elevations_deg[0], s.elevations_deg[-1]
        rings = f"{len(s.elevations_deg)}, {low:g} to {high:g}" if low < high else "1, level"
        noise = f"{s.noise_m * 1000:g} mm" if s.noise_m else f"{s.noise_share * 100:g} %"
        beams, reach = s.n_beams // len(s.elevations_deg), f"{s.nearest_m:g} to {s.farthest_m:g}"
        rows.append(f"| `{name}` ({s.title}) | {rings} | {beams} | {reach} | {noise} |")
    return "\n".join(rows)


FORM = ViewForm(
    "lidar",
    write_lidar,
    "a laser scan at each view's eye (`--scanner`: "
    + ", ".join(f"`{name}`" for name in LIDARS)
    + "):"
    " `<house>/<view>.ply` and `.pcd`, `<house>/poses.txt`",
    options=LidarOptions,
    convention=Convention(
        None,
        axes="scanner x forward, y left, z up, m; poses in the home's world, y up",
        depth="m, along the beam",
    ),
)
