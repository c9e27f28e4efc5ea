"""The method by which `verify` recomputes each file of a root, and the files that it does not recompute; no effects.

A file without a row is compared with its hash and, if it is a layer, its size and type.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from pbrs_farm.check.checks import all_checks
from pbrs_farm.check.fields import field_lines
from pbrs_farm.check.intrinsic_checks import LAYERS as INTRINSIC
from pbrs_farm.check.pixel_checks import RAY_LAYERS
from pbrs_farm.check.stored_view import StoredView
from pbrs_farm.core.layers import LAYER, LAYERS, MOST_VARIANTS, OWN_LAYERS

RAYS = "recomputed by rays"
FORMULA = "recomputed from other layers"
_MOTION = "followed by rays from view to view"
_BEHIND = "recomputed by rays without glass"
_MIRRORED = "recomputed by rays that mirrors send on"
_INTRINSIC = "albedo x shading + residual against radiance.exr developed again, matte surfaces and clear ones by materials"
_NOISE = "each value within its noise, mean and spread by their statistics"

# File -> how it is recomputed. Checks may have further ones: see `how_of_files`.
HOW: dict[str, str] = {
    **{LAYER[name].file: RAYS for name in RAY_LAYERS},
    "boundary.png": FORMULA, "boundary_semantic.png": FORMULA, "nyu13.png": FORMULA,
    "class_source.png": FORMULA, "hha.png": FORMULA, "histogram.json": FORMULA,
    "depth_sensor.png": _NOISE, "depth_sensor_tof.png": _NOISE, "depth_sensor_stereo.png": _NOISE,
    "depth_sensor_d455.png": _NOISE, "depth_sensor_azure.png": _NOISE, "depth_sensor_l515.png": _NOISE,
    "mlt_ol.png": "developed from radiance.exr again",
    "mlt_il_ol.png": "developed from radiance.exr again",
    **{LAYER[f"mlt_il_ol.{n}"].file: "developed from radiance.exr again" for n in range(1, MOST_VARIANTS + 1)},
    "opengl_dl.png": "its edges against those of the instances",
    "opengl_il.png": "its edges against those of the instances",
    "articulation.json": "joints against house.json, their axes turned into the camera's frame again",
    "view.json": "camera by rays; boxes, shares and counts recomputed; each field has its check",
    "radiance.exr": "its guides against surfaces, its steps against their albedo, sun and bulbs by shadow rays",
    "projector.png": "dots thrown again by rays, where rays through pixels meet",
    **{f"{name}.exr": _INTRINSIC for name in INTRINSIC},
    "boundary_occlusion.png": FORMULA, "boundary_crease.png": FORMULA,
    "behind_glass/depth.png": _BEHIND, "behind_glass/normal.png": _BEHIND,
    "behind_glass/semantic.png": _BEHIND, "behind_glass/instance.png": _BEHIND,
    "behind_mirror/depth.png": _MIRRORED, "behind_mirror/normal.png": _MIRRORED,
    "behind_mirror/semantic.png": _MIRRORED, "behind_mirror/instance.png": _MIRRORED,
    "flow_forward.exr": _MOTION, "flow_forward_kitti.png": _MOTION, "occlusion_forward.png": _MOTION,
    "scene_flow.exr": _MOTION, "flow_backward.exr": _MOTION, "flow_backward_kitti.png": _MOTION,
    "occlusion_backward.png": _MOTION, "disparity.png": _MOTION, "occlusion_stereo.png": _MOTION,
}  # fmt: skip

# The same of the files of a house and of a root, beside their fields.
HOW_OF_HOUSE: dict[str, str] = {
    "house.glb": "its triangles are what rays meet; items, materials and pictures are those of house.json",
    "house.json": "each field has its check", "cameras.json": "each field has its check",
    "illuminance.json": "each field has its check; no light is traced",
    "repair.json": "rooms and lamps as house.json", "dress.json": "credits as ATTRIBUTION.txt",
    "tracks.npz": "points followed by rays through up to twelve stored frames", "pairs.parquet": "followed by rays from view to view", "manifest.jsonl": "each file's size and hash",
    "recipe.json": "by the digest and the seeds of its views", "ATTRIBUTION.txt": "names what dress.json says must be",
}  # fmt: skip

# Facts that no file of a root holds.
_NEVER = (
    "levels of light, but for bulbs that are seen and what sun and bulbs bring at least: no light is traced",
    "house.glb and house.json against their source, which is not stored",
)


def how_of_files() -> dict[str, str]:
    """File of a view -> how it is recomputed, also by checks of the table."""
    return HOW | {file: how for check in all_checks() for file, how in check.files.items()}


def looked_at(views: list[StoredView], fields: Counter[tuple[str, str]]) -> tuple[str, ...]:
    """A line for each kind of recomputed file: its name, the number of views, the method.

    Then the number of kinds of fields of each JSON file that have a check (fields: as of
    `fields.stored_fields`).
    """
    counts, how_of = _file_counts(views), how_of_files()
    files = tuple(f"{file} ({counts[file]}): {how}" for file, how in how_of.items() if counts[file])
    return (*files, *field_lines(fields)[0])


def not_looked_at(
    root: Path,
    houses: list[Path],
    views: list[StoredView],
    fields: Counter[tuple[str, str]],
    n_halved: int = 0,
) -> tuple[str, ...]:
    """A line for each kind of file that only has a hash, or little more, and for each field without a check.

    With each view whose light could not be developed again and why, the number of views that were
    denoised at half their size, and the lines that apply to every root.
    """
    counts, how_of = _file_counts(views), how_of_files()
    layers = {layer.file for layer in LAYERS}
    lines = []
    for file in sorted(counts):
        if file not in how_of:
            how = "hash, size and type alone" if file in layers else "hash alone"
            lines.append(f"{file} ({counts[file]}): {how}")
    lines += unknown_files(root, houses)
    lines += field_lines(fields)[1]
    lines += [f"light of {view.place}: {why}" for view in views if (why := _light_fault(view))]
    if n_halved:
        lines.append(
            f"light of {n_halved} views was denoised again at half its size: compared by tiles of 32 px; "
            "--all denoises it as it stands"
        )
    return (*lines, *_NEVER)


def unknown_files(root: Path, houses: list[Path]) -> list[str]:
    """A line for each file beside the views that no check opens."""
    counts = Counter(file.name for file in root.glob("*") if file.is_file())
    for house in houses:
        counts.update(file.name for file in house.glob("*") if file.is_file())
    return [
        f"{name} ({n}): no check knows it"
        for name, n in sorted(counts.items())
        if name not in HOW_OF_HOUSE
    ]


def unowned_layers() -> list[str]:
    """Files of layers of the package that no check recomputes."""
    return [layer.file for layer in OWN_LAYERS if layer.file not in how_of_files()]


def _file_counts(views: list[StoredView]) -> Counter[str]:
    return Counter(
        str(file.relative_to(view.folder).as_posix())
        for view in views
        for file in Path(view.folder).rglob("*")
        if file.is_file()
    )


def _light_fault(view: StoredView) -> str:
    """Why a view's light modes were not compared by pixels; "" if they were, or if there are no such modes."""
    if not (view.has("mlt_ol.png") or view.has("mlt_il_ol.png")):
        return ""
    if view.recipe is None:
        return "no recipe.json that says how it was developed"
    if not view.has("radiance.exr"):
        return "no radiance.exr to develop"
    if view.recipe.sensor.is_on or view.recipe.tone.camera != "neutral":
        return "taken by a sensor: compared by tiles of 16 px, not by pixels"
    if view.recipe.tone.variants:
        return "its variants are taken by sensors: compared by tiles of 16 px, not by pixels"
    return ""
