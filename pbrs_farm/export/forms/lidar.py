"""Laser scans: one turn of a scanner at each view's eye, as PLY and as PCD.

    <house>/<view>.ply  <house>/<view>.pcd  <house>/poses.txt

Effects: reads views and their house.glb, writes files. The scanner is upright at the camera's eye and
faces the camera's direction; a walk has a scan a frame. truth/lidar.py computes the beams.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.options import option
from pbrs_farm.core.record import Record
from pbrs_farm.export.chosen_view import Choice, ChosenView, place_and_quaternion
from pbrs_farm.export.content import Files, Line, numbers, write_files
from pbrs_farm.export.export_homes import stored_house
from pbrs_farm.export.form import Convention, ViewForm
from pbrs_farm.export.sequences import by_house
from pbrs_farm.formats.ply import ply_bytes, records_of
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.run.house_cache import decoded_textures
from pbrs_farm.truth.lidar import LIDARS, LidarScan, LidarSensor, lidar_scan

# Fields that PCD names otherwise.
_PCD_NAMES: Final = {f"n{axis}": f"normal_{axis}" for axis in "xyz"}


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
    for house_id, house_views in by_house(first_views).items():
        write_files(out / house_id, _scans(house_views, scanner))


def _scans(views: list[ChosenView], scanner: str) -> Iterator[Files]:
    sensor = LIDARS[scanner]
    house = stored_house(views[0].entry.folder.parent.parent)
    caster, (textures, _unread) = Caster.of_house(house), decoded_textures(house)
    for number, view in enumerate(views):
        pose = scanner_pose(view)
        seed = keys.seed(house.id, view.id, "lidar", scanner)
        scan = lidar_scan(caster, house, pose, sensor, textures, seed=seed)
        records, words = _records(scan), numbers(place_and_quaternion(pose))
        time = view.facts.get("time_s")
        yield {
            f"{view.id}.ply": _ply(records, view, sensor),
            f"{view.id}.pcd": _pcd(records, words),
            "poses.txt": Line(f"{number if time is None else time:.6f} {words}"),
        }


def scanner_pose(view: ChosenView) -> F64:
    """(4, 4) world from scanner: at the view's eye, upright, forward in the camera's direction.

    Of a camera that looks straight up or down, the picture's up is forward.
    """
    camera = view.pose
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
    floats = {
        **dict(zip("xyz", scan.points.T, strict=True)),
        "intensity": scan.intensity,
        "range": scan.range_m,
        "range_true": scan.true_range_m,
        **dict(zip(("nx", "ny", "nz"), scan.normals.T, strict=True)),
    }
    labels = {"ring": scan.ring, "label": scan.label, "instance": scan.instance, "via": scan.via}
    flags = {"through": scan.through, "mirrored": scan.mirrored}
    kinds = ((floats, np.float32), (labels, np.uint16), (flags, np.uint8))
    return records_of(
        {name: v.astype(kind) for columns, kind in kinds for name, v in columns.items()}
    )


def _ply(records: NDArray[Any], view: ChosenView, sensor: LidarSensor) -> bytes:
    beams = f"{len(records)} of {sensor.n_beams} beams"
    place = f"{view.house.id}/{view.id}, {sensor.title}: {beams}"
    axes = "metres, x forward, y left, z up"
    return ply_bytes(records, [place, axes, view.house.attribution])


def _pcd(records: NDArray[Any], words: str) -> bytes:
    x, y, z, qx, qy, qz, qw = words.split()
    names = records.dtype.names or ()
    types = [records.dtype[name] for name in names]
    lines = [
        "# .PCD v0.7 - Point Cloud Data file format",
        "VERSION 0.7",
        f"FIELDS {' '.join(_PCD_NAMES.get(name, name) for name in names)}",
        f"SIZE {' '.join(str(kind.itemsize) for kind in types)}",
        f"TYPE {' '.join(kind.kind.upper() for kind in types)}",
        f"COUNT {' '.join('1' for _ in names)}",
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
