"""What a view's files must be by themselves: sizes, types, tables, boundaries; no rays.

Effects: reads files.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.darkness_checks import check_darkness
from pbrs_farm.check.lamp_checks import check_lamps
from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.check.stored_view import StoredView
from pbrs_farm.core.classes import NYU13_FROM_NYU40, NYU40_NAMES
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.layers import LAYERS, Layer

BASIC = tuple(x.name for x in LAYERS if x.step == "truth" and not x.optional)

# Share of neighbours with one normal that may lie on different planes: steps, shelves, slats.
# Real views have less than 0.01; depth along the ray, or normals in another frame, nearly 1.
MAX_OFF = 0.05
_NORMAL_ERROR = 1e-4  # of a component stored in 16 bits


def read_labels(view: StoredView, tally: Tally) -> dict[str, NDArray[Any]] | None:
    """The basic layers by name, None when one of them is missing, damaged or of a wrong shape.

    Optional layers are in it where the view has their file and it can be read; radiance is left to
    the check of the light. Every fault is told to the tally here.
    """
    arrays = {}
    for layer in LAYERS:
        # A basic layer that is missing fails; an optional one may be absent.
        if layer.name in BASIC or (view.has(layer.file) and layer.name != "radiance"):
            array = _read_layer(view, layer, tally)
            if array is not None:
                arrays[layer.name] = array
    return arrays if all(name in arrays for name in BASIC) else None


def _read_layer(view: StoredView, layer: Layer, tally: Tally) -> NDArray[Any] | None:
    place = f"{view.place}/{layer.file}"
    if not tally.expect("layers", place, view.has(layer.file), "is missing"):
        return None
    try:
        array = view.png(layer.file) if layer.file.endswith(".png") else _planes(view, layer)
    except (BadInput, KeyError) as error:
        tally.expect("layers", place, False, str(error))
        return None
    # Vectors and colours have a third axis, every other layer two axes.
    depth = {"RGB": (3,), "R G B": (3,), "X Y Z": (3,), "X Y": (2,)}.get(layer.channels, ())
    shape = (*view.size, *depth)
    # An EXR is read as 32-bit floats, whatever it holds.
    dtype = "float32" if layer.dtype == "float16" else layer.dtype
    fits = array.shape == shape and str(array.dtype) == dtype
    what = f"{array.shape} {array.dtype}, expected {shape} {layer.dtype}"
    return array if tally.expect("layers", place, fits, what) else None


def _planes(view: StoredView, layer: Layer) -> NDArray[np.float32]:
    """The channels of an EXR layer, stacked when there are several."""
    channels = view.exr(layer.file)
    planes = [channels[name] for name in layer.channels.split()]
    return planes[0] if len(planes) == 1 else np.stack(planes, axis=-1)


def read_radiance(view: StoredView, tally: Tally) -> dict[str, NDArray[np.float32]] | None:
    """The channels of radiance.exr; None where the view has none, or it cannot be read."""
    if not view.has("radiance.exr"):
        return None
    try:
        return view.exr("radiance.exr")
    except BadInput as error:
        tally.expect("radiance", view.place, False, str(error))
        return None


def check_pictures(view: StoredView, arrays: dict[str, NDArray[Any]], tally: Tally) -> None:
    """No OpenGL picture is one colour.

    A light mode may be: without a window, outdoor light alone leaves a room black. That is noted.
    """
    for layer in LAYERS:
        if layer.step != "truth" and layer.name in arrays:
            picture = arrays[layer.name]
            constant = bool((picture == picture[0, 0]).all())
            # Developed modes may be black, and so may any picture of a view that sees nothing.
            may_be = layer.step == "develop" or not arrays["valid"].any()
            place = f"{view.place}/{layer.file}"
            tally.expect("pictures", place, not constant or may_be, "is one colour")
            if constant:
                tally.note(f"{place} is one colour: {picture[0, 0].tolist()}")


def check_radiance(
    view: StoredView,
    house: StoredHouse,
    channels: dict[str, NDArray[np.float32]],
    valid: NDArray[Any],
    tally: Tally,
) -> None:
    """Every group of light is there, finite and not negative; lamps are those of the house.

    channels: of radiance.exr; valid: (H, W), 0 where nothing is hit.
    """
    names = {f"{g}.{c}" for g in ("outdoor", "indoor", "albedo") for c in "RGB"}
    lacking = names - channels.keys()
    tally.expect("radiance", view.place, not lacking, f"lacks {lacking}")
    # Normals may be negative; light and albedo may not.
    names |= {name for name in channels if name.startswith(("lamp", "diffuse_"))}
    for name in sorted(names & channels.keys()):
        plane = channels[name]
        bad = int((~(np.isfinite(plane) & (plane >= 0))).sum())
        tally.add("radiance", plane.size)
        if bad or plane.shape != view.size:
            what = f"{bad} pixels negative or not finite"
            tally.fail("radiance", f"{view.place} {name}", what, max(bad, 1))
    check_lamps(view, house, channels, tally)
    check_darkness(view, channels, valid, tally)


def check_consistency(view: StoredView, arrays: dict[str, NDArray[Any]], tally: Tally) -> None:
    """Layers against each other over the whole picture: valid, unit normals, ids, boundary.

    Needs no rays: it runs on every pixel of every view. arrays has at least the basic layers, all
    of the view's size.
    """
    instance, depth, valid = arrays["instance"], arrays["depth"], arrays["valid"]
    _same(view, tally, "valid = depth", (valid == 255) == (depth > 0))
    _same(view, tally, "valid is 0 or 255", (valid == 255) | (valid == 0))
    _same(view, tally, "instance = depth", (instance > 0) == (depth > 0))
    _same(view, tally, "unit normals", _is_unit(arrays["normal"], valid))
    # Look the class of each instance up in the table.
    classes = np.zeros(65536, np.int64)
    for instance_id, nyu40 in view.nyu40.items():
        classes[instance_id] = nyu40
    _same(view, tally, "semantic = table", classes[instance] == arrays["semantic"])
    _same(view, tally, "boundary", arrays["boundary"] == np.where(_boundary(instance), 255, 0))
    _check_optional(view, arrays, tally)
    _check_table(view, instance, tally)


def _check_optional(view: StoredView, arrays: dict[str, NDArray[Any]], tally: Tally) -> None:
    """Optional layers that other layers decide, or that hold few values."""
    semantic = arrays["semantic"]
    if "nyu13" in arrays:
        _same(view, tally, "nyu13", arrays["nyu13"] == NYU13_FROM_NYU40[semantic.clip(0, 40)])
    if "boundary_semantic" in arrays:
        edges = np.where(_boundary(semantic), 255, 0)
        _same(view, tally, "boundary_semantic", arrays["boundary_semantic"] == edges)
    if "class_source" in arrays:
        _same(view, tally, "class_source", _source_class_is_right(view, arrays))


def _is_unit(normal_label: NDArray[Any], valid: NDArray[Any]) -> NDArray[np.bool_]:
    """(H, W) bool: stored normals have length 1 where something is hit, 0 elsewhere."""
    length = np.linalg.norm(normal_label * (2 / 65535) - 1, axis=-1)
    return np.asarray(np.where(valid > 0, np.abs(length - 1) < 1e-3, length < 1e-4), bool)


def _source_class_is_right(view: StoredView, arrays: dict[str, NDArray[Any]]) -> NDArray[np.bool_]:
    """(H, W) bool: the id's name in the table is the source class of the instance there."""
    # Number of each instance's source class, 0 where it has none.
    names = {int(k): name for k, name in view.table.get("source_classes", {}).items()}
    number = {name: k for k, name in names.items()}
    expected = np.zeros(65536, np.int64)
    for row in view.table["instances"]:
        expected[int(row["id"])] = number.get(row["source_class"], 0)
    return np.asarray(arrays["class_source"] == expected[arrays["instance"]], bool)


def _same(view: StoredView, tally: Tally, check: str, right: NDArray[np.bool_]) -> None:
    tally.add(check, right.size)
    if not right.all():
        row, column = np.argwhere(~right)[0]
        tally.fail(check, view.place, f"row {row}, column {column}", int((~right).sum()))


def _boundary(ids: NDArray[Any]) -> NDArray[np.bool_]:
    """The published instance boundary: any unequal adjacent pair in the block to the lower right."""
    # The pixel and its neighbours right, below, and right below; edges repeat themselves.
    padded = np.pad(ids.astype(np.int64), ((0, 1), (0, 1)), mode="edge")
    a, b, c, d = padded[:-1, :-1], padded[:-1, 1:], padded[1:, :-1], padded[1:, 1:]
    return np.asarray((a != b) | (a != c) | (b != d) | (c != d), bool)


def _check_table(view: StoredView, instance: NDArray[Any], tally: Tally) -> None:
    """The table has a row for each id in the picture, with its pixels, share, box and class name."""
    # The ids in the picture are those of the table.
    counts = np.bincount(instance.reshape(-1), minlength=1)
    seen = {int(i) for i in np.nonzero(counts)[0]} - {0}
    rows = {int(row["id"]): row for row in view.table["instances"]}
    tally.expect("table", view.place, seen == rows.keys(), f"ids {sorted(seen ^ rows.keys())[:5]}")
    boxes = ndimage.find_objects(instance.astype(np.int32))
    for i in sorted(seen & rows.keys()):
        # Pixels, share, box and class name follow from the picture.
        row, (ys, xs) = rows[i], boxes[i - 1]
        place = f"{view.place} instance {i}"
        tally.expect("table", place, row["pixels"] == counts[i], f"{counts[i]} pixels")
        share = abs(row["fraction"] - counts[i] / instance.size) < 1e-9
        tally.expect("table", place, share, "fraction is not pixels over the picture's")
        box = [xs.start, ys.start, xs.stop, ys.stop]
        tally.expect("table", place, row["box2d"] == box, f"box2d is not {box}")
        named = row["class"] == NYU40_NAMES[int(row["nyu40"])]
        tally.expect("table", place, named, f"class {row['class']} is not {row['nyu40']}")


def check_planes(view: StoredView, arrays: dict[str, NDArray[Any]], tally: Tally) -> None:
    """Where two neighbours show one instance with one normal, the plane through the first predicts
    the depth of the second: to rounding, and what a normal of 16 bits loses on slanting faces."""
    # Rays of unit depth through the pixels, in the camera's frame.
    depth, normal, instance = arrays["depth"] / 1000, arrays["normal"], arrays["instance"]
    height, width = view.size
    rows, columns = (g.reshape(-1) for g in np.mgrid[0:height, 0:width])
    _, rays = view.rays(rows, columns)
    rays = (rays @ view.world_from_camera[:3, :3]).reshape(height, width, 3)
    decoded = normal * (2 / 65535) - 1
    # Published axes are x right, y forward, z up; the rays' are x right, y down, z forward.
    facing = np.stack([decoded[..., 0], -decoded[..., 2], decoded[..., 1]], axis=-1)

    # Pair each pixel with its right neighbour, where both show one surface.
    left, right = np.s_[:, :-1], np.s_[:, 1:]
    same = (normal[left] == normal[right]).all(-1) & (instance[left] == instance[right])
    same &= (depth[left] > 0) & (depth[right] > 0)
    here = np.einsum("ni,ni->n", facing[left][same], rays[left][same])
    there = np.einsum("ni,ni->n", facing[left][same], rays[right][same])
    near, far = depth[left][same], depth[right][same]
    # Follow the plane through the first to the ray of the second.
    with np.errstate(divide="ignore", invalid="ignore"):
        predicted = near * here / there
        slack = 0.0012 * (1 + np.abs(predicted / near)) + _NORMAL_ERROR * far / np.abs(there)
        off = int((~(np.abs(predicted - far) <= slack)).sum())
    allowed = off <= max(10, MAX_OFF * len(near))
    tally.add("depth on planes", len(near), ties=off if allowed else 0)
    if not allowed:
        what = f"{off} of {len(near)} neighbours do not lie on the plane of their normal"
        tally.fail("depth on planes", view.place, what, off)
