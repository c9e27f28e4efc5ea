"""The layers of a view against each other over whole pictures: tables, boundaries, planes, edges
of OpenGL pictures and histograms. Effects: reads files.

docs/formats/layer_rules.md has the rules of boundaries. Depth is known to half a millimetre and normals to 16 bits: where
a rule depends on less, either value is right.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pbrs_farm.check.axes import camera_normals, dot, stored_normals
from pbrs_farm.check.cases import Layers, ViewCase
from pbrs_farm.check.checks import Check
from pbrs_farm.check.rules import judge
from pbrs_farm.check.stored_files import BadFile, stored_object
from pbrs_farm.check.stored_view import StoredView
from pbrs_farm.core.arrays import F64, I64, Bools
from pbrs_farm.core.classes import NYU13_FROM_NYU40, NYU40_NAMES
from pbrs_farm.core.house import ItemKind
from pbrs_farm.core.layers import LAYERS

# Share of neighbours with one normal that may be on different planes: steps, shelves, slats.
# Real views have less than 0.01; depth along the ray, or normals in another frame, nearly 1.
_MAX_OFF = 0.05
_NORMAL_ERROR = 1e-4  # of a component stored in 16 bits
_ROUNDING_M = 0.0012  # of two depths in whole mm
_N_IDS = 65536
_CREASE_COSINE = float(np.cos(np.radians(30)))
_COSINE_ERROR = 2e-4
_FARTHEST_MM = 65535  # largest depth that 16 bits hold, and every larger one
_GAP_M, _GAP_SHARE = 0.03, 0.02  # least step of an occlusion, and as a share of the nearer depth
_OWNER, _HIDDEN = 255, 128
_MODES = ("mlt_il_ol", "mlt_ol", "opengl_il", "opengl_dl")
_MIN_EDGE_PX = 40  # of boundaries that comparing edges needs
_SHIFT_PX = 3  # by which a picture is moved to see whether it fits better
_RUN_PX = 4  # of an outline: pixels of a straight edge say the same
_MOVES = {
    "right": (0, _SHIFT_PX), "left": (0, -_SHIFT_PX), "bottom": (_SHIFT_PX, 0), "top": (-_SHIFT_PX, 0),
}  # fmt: skip


def check_pictures(case: ViewCase) -> None:
    """No OpenGL picture is of one colour; one of a light mode may be, and is noted."""
    for layer in LAYERS:
        if layer.step != "truth" and layer.name in case.arrays:
            picture = case.arrays[layer.name]
            constant = bool((picture == picture[0, 0]).all())
            # Developed modes may be black, and so may any picture of a view that sees nothing.
            may_be = layer.step == "develop" or not case.arrays["valid"].any()
            case.expect("pictures", layer.file)(not constant or may_be, "is one colour")
            if constant:
                colour = picture[0, 0].tolist()
                case.tally.note(f"{case.place}/{layer.file} is one colour: {colour}")


def check_consistency(case: ViewCase) -> None:
    """Layers against each other: valid, unit normals, ids, boundary, classes, and the table."""
    arrays, view = case.arrays, case.view
    instance, depth, valid = arrays["instance"], arrays["depth"], arrays["valid"]
    semantic = arrays["semantic"]
    classes = np.zeros(_N_IDS, np.int64)
    for instance_id, nyu40 in view.nyu40.items():
        classes[instance_id] = nyu40
    right = {
        "valid = depth": (valid == 255) == (depth > 0),
        "valid is 0 or 255": (valid == 255) | (valid == 0),
        "instance = depth": (instance > 0) == (depth > 0),
        "unit normals": _is_unit(arrays["normal"], valid),
        "semantic = table": classes[instance] == semantic,
        "boundary": arrays["boundary"] == _boundary(instance),
    }
    if "nyu13" in arrays:
        right["nyu13"] = arrays["nyu13"] == NYU13_FROM_NYU40[semantic.clip(0, 40)]
    if "boundary_semantic" in arrays:
        right["boundary_semantic"] = arrays["boundary_semantic"] == _boundary(semantic)
    if "class_source" in arrays:
        right["class_source"] = arrays["class_source"] == _source_classes(view, arrays)
    for check, pixels in right.items():
        case.tally.pixels(check, case.place, pixels)
    _check_table(case)


def _is_unit(normal_label: NDArray[Any], valid: NDArray[Any]) -> Bools:
    """(H, W) stored normals have length 1 where something is hit, 0 elsewhere."""
    length = np.linalg.norm(stored_normals(normal_label), axis=-1)
    return np.asarray(np.where(valid > 0, np.abs(length - 1) < 1e-3, length < 1e-4), bool)


def _source_classes(view: StoredView, arrays: Layers) -> NDArray[Any]:
    """(H, W) number of each instance's source class in the view's table, 0 for none."""
    names = view.table.get("source_classes", {})
    number = {name: int(k) for k, name in names.items()}
    classes = np.zeros(_N_IDS, np.int64)
    for row in view.table["instances"]:
        classes[int(row["id"])] = number.get(row["source_class"], 0)
    return np.asarray(classes[arrays["instance"]])


def _boundary(ids: NDArray[Any]) -> NDArray[Any]:
    """(H, W) the published instance boundary: 255 for an unequal adjacent pair in the block to the lower right."""
    # Edges of the picture repeat themselves.
    padded = np.pad(ids.astype(np.int64), ((0, 1), (0, 1)), mode="edge")
    a, b, c, d = padded[:-1, :-1], padded[:-1, 1:], padded[1:, :-1], padded[1:, 1:]
    return np.where((a != b) | (a != c) | (b != d) | (c != d), 255, 0)


def _check_table(case: ViewCase) -> None:
    """The table has a row for each id in the picture, with its pixels, share, box and class name."""
    instance = case.arrays["instance"]
    counts = np.bincount(instance.reshape(-1), minlength=1)
    ids = {int(i) for i in np.nonzero(counts)[0]} - {0}
    rows = {int(row["id"]): row for row in case.view.table["instances"]}
    case.expect("table")(ids == rows.keys(), f"ids {sorted(ids ^ rows.keys())[:5]}")
    boxes = ndimage.find_objects(instance.astype(np.int32))
    for i in sorted(ids & rows.keys()):
        ys, xs = boxes[i - 1]
        picture = {
            "pixels": int(counts[i]), "fraction": counts[i] / instance.size,
            "box": [xs.start, ys.start, xs.stop, ys.stop], "class": NYU40_NAMES[int(rows[i]["nyu40"])],
        }  # fmt: skip
        place = f"{case.place} instance {i}"
        judge("pixels of an instance", place, case.tally, row=rows[i], picture=picture)


def check_planes(case: ViewCase) -> None:
    """Of neighbours with one instance and normal, the plane through the first predicts the second's depth."""
    # Rays of unit depth through the pixels, in the camera's frame.
    arrays, view = case.arrays, case.view
    depth, normal, instance = arrays["depth"] / 1000, arrays["normal"], arrays["instance"]
    rays = view.ray_grid() @ view.world_from_camera[:3, :3]
    facing = camera_normals(normal)

    # Pair each pixel with its right neighbour, where both show one surface.
    west, east = np.s_[:, :-1], np.s_[:, 1:]
    same = (normal[west] == normal[east]).all(-1) & (instance[west] == instance[east])
    same &= (depth[west] > 0) & (depth[east] > 0)
    first = dot(facing[west][same], rays[west][same])
    second = dot(facing[west][same], rays[east][same])
    near, far = depth[west][same], depth[east][same]
    # Follow the plane through the first to the ray of the second.
    with np.errstate(divide="ignore", invalid="ignore"):
        predicted = near * first / second
        slack = _ROUNDING_M * (1 + np.abs(predicted / near)) + _NORMAL_ERROR * far / np.abs(second)
        off = int((~(np.abs(predicted - far) <= slack)).sum())
    fault = f"{off} of {len(near)} neighbours are not on the plane of their normal"
    most = max(10, _MAX_OFF * len(near))
    case.tally.tolerate("depth on planes", case.place, len(near), off, most, fault)


class _Sides(NamedTuple):
    """One of the two pixels of each pair."""

    z: F64
    normal: F64
    ray: F64


def check_typed_boundaries(case: ViewCase) -> None:
    """Judge boundary_occlusion and boundary_crease; a pixel that rounding may change is right either way."""
    view, arrays = case.view, case.arrays
    height, width = view.size
    rays = view.ray_grid() @ view.world_from_camera[:3, :3]
    normal = camera_normals(arrays["normal"])
    z = arrays["depth"] / 1000
    # Steps beyond what 16 bits hold are unknown.
    far = arrays["depth"] >= _FARTHEST_MM
    least, most = np.zeros((height, width), int), np.zeros((height, width), int)
    creases: list[tuple[Bools, Bools]] = []
    for first, second in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        a, b = (_Sides(z[s], normal[s], rays[s]) for s in (first, second))
        gap, may_be_gap = _gaps(a, b)
        is_open = far[first] | far[second]
        gap, may_be_gap = gap & ~is_open, may_be_gap | is_open
        nearer = _is_nearer(a.z, b.z)
        for side, is_near in ((first, nearer), (second, ~nearer)):
            mark = np.where(is_near, _OWNER, _HIDDEN)
            least[side] = np.maximum(least[side], np.where(gap, mark, 0))
            may_be = np.where(may_be_gap, np.where(is_open, _OWNER, mark), 0)
            most[side] = np.maximum(most[side], may_be)
        cosine = dot(a.normal, b.normal)
        hit = (a.z > 0) & (b.z > 0)
        crease = hit & ~may_be_gap & (cosine < _CREASE_COSINE - _COSINE_ERROR)
        creases.append((crease, hit & ~gap & (cosine < _CREASE_COSINE + _COSINE_ERROR)))
    if "boundary_occlusion" in arrays:
        stored = arrays["boundary_occlusion"].astype(int)
        right = np.isin(stored, (0, _HIDDEN, _OWNER)) & (least <= stored) & (stored <= most)
        case.tally.pixels("boundary_occlusion", case.place, right)
    if "boundary_crease" in arrays:
        stored = arrays["boundary_crease"]
        crease, may_be_crease = (_in_blocks(across, down) for across, down in zip(*creases))
        right = np.where(stored == 255, may_be_crease, (stored == 0) & ~crease)
        case.tally.pixels("boundary_crease", case.place, right)


def _gaps(a: _Sides, b: _Sides) -> tuple[Bools, Bools]:
    """(N,) depth steps between the pixels of each pair for sure; and it may."""
    near = np.minimum(a.z, b.z)
    limit = np.maximum(_GAP_M, _GAP_SHARE * near)
    step = np.abs(a.z - b.z)
    (miss_b, slack_b), (miss_a, slack_a) = _miss(a, b), _miss(b, a)
    sizes, slacks = np.abs([miss_a, miss_b]), np.array([slack_a, slack_b])
    # No step if a plane goes on to the other pixel, or both planes meet between the two.
    on_plane = (sizes + slacks).min(0) <= limit - _ROUNDING_M
    may_be_on = (sizes - slacks).min(0) <= limit + _ROUNDING_M
    a_before, b_before = miss_a < -slack_a, miss_b < -slack_b
    a_behind, b_behind = miss_a > slack_a, miss_b > slack_b
    meet = (a_before & b_before) | (a_behind & b_behind)
    part = (a_before & b_behind) | (a_behind & b_before)
    hit = near > 0
    is_gap = (step > limit + _ROUNDING_M) & ~(hit & (may_be_on | ~part))
    may_be_gap = (step > limit - _ROUNDING_M) & ~(hit & (on_plane | meet))
    return is_gap, may_be_gap


def _miss(side: _Sides, other: _Sides) -> tuple[F64, F64]:
    """Distance of the other's depth from the plane here, and its rounding error; metres."""
    cosine = dot(side.normal, side.ray)
    other_cosine = dot(side.normal, other.ray)
    with np.errstate(divide="ignore", invalid="ignore"):
        predicted = side.z * cosine / other_cosine
        size = np.abs(predicted)
        slack = _ROUNDING_M * (1 + np.abs(predicted / np.maximum(side.z, 1e-6)))
        slack += _NORMAL_ERROR * size * (2 / np.abs(other_cosine) + 1)
    # A plane that grazes the ray may be met in front of the eye or far behind.
    graze = ~(np.abs(other_cosine) > 4 * _NORMAL_ERROR)
    ahead = np.where(predicted > 0, predicted, np.inf)
    miss = np.nan_to_num(ahead - other.z, nan=0.0, posinf=1e9)
    return miss, np.where(graze, np.inf, np.nan_to_num(slack, nan=np.inf, posinf=np.inf))


def _is_nearer(a: F64, b: F64) -> Bools:
    """The first depth is nearer than the second, where 0 is infinitely far."""
    return np.asarray(np.where(a > 0, a, np.inf) < np.where(b > 0, b, np.inf), bool)


def _in_blocks(across: Bools, down: Bools) -> Bools:
    """(H, W) any edge within the block of a pixel and its neighbours right and below."""
    edge = np.zeros((across.shape[0], down.shape[1]), bool)
    edge[:, :-1] |= across
    edge[:-1, :] |= down
    edge[:-1, :-1] |= across[1:, :] | down[:, 1:]
    return edge


def check_edges(case: ViewCase) -> None:
    """The edges of OpenGL pictures fit the instances better than any mirrored, turned or shifted copy does."""
    outline = _outline(case.arrays["instance"])
    for mode in ("opengl_dl", "opengl_il"):
        if mode not in case.arrays:
            continue
        n_edge = int(outline.sum())
        if n_edge < _MIN_EDGE_PX:
            case.tally.note(f"{case.place}/{mode}.png has too few edges to compare")
            continue
        edges = _steps(case.arrays[mode])
        copies = moved_copies(edges)
        for side, step in _MOVES.items():
            copies[f"{_SHIFT_PX} px more to the {side}"] = np.roll(edges, step, (0, 1))
        as_stored = _fit(outline, edges)
        # The standard error of a correlation of so many independent edges.
        by_chance = (_RUN_PX / n_edge) ** 0.5
        for name, copy in copies.items():
            fit = _fit(outline, copy)
            fault = f"fits the instances better {name} ({fit:.3f}) than as stored ({as_stored:.3f})"
            case.expect("opengl edges", f"{mode}.png")(fit <= as_stored + by_chance, fault)


def moved_copies(picture: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """A picture mirrored, upside down and turned, by these names."""
    return {
        "mirrored": picture[:, ::-1],
        "upside down": picture[::-1],
        "turned": picture[::-1, ::-1],
    }


def _outline(instance: NDArray[Any]) -> Bools:
    """(H, W) pixels beside another instance."""
    cross = ndimage.generate_binary_structure(2, 1)
    most, least = (
        f(instance, footprint=cross) for f in (ndimage.maximum_filter, ndimage.minimum_filter)
    )
    return np.asarray(most != least, bool)


def _steps(picture: NDArray[Any]) -> F64:
    """(H, W) change of a picture around each pixel, compressed so that no edge outweighs the others."""
    grey = picture.astype(float).mean(axis=-1)
    across = np.abs(np.diff(grey, axis=1, prepend=grey[:, :1]))
    down = np.abs(np.diff(grey, axis=0, prepend=grey[:1]))
    return np.asarray(np.sqrt(np.maximum(across, down)))


def _fit(outline: Bools, edges: F64) -> float:
    """Correlation of outlines with edges; 0 if either is flat."""
    if outline.all() or not outline.any() or np.ptp(edges) == 0:
        return 0.0
    return float(np.corrcoef(outline.reshape(-1).astype(float), edges.reshape(-1))[0, 1])


def check_histogram(case: ViewCase) -> None:
    """Count the view's histograms and quality numbers again, each expected separately."""
    place = f"{case.place}/histogram.json"
    try:
        stored = stored_object(case.view.folder / "histogram.json")
        numbers = _compare(case, stored) | _compare_home(case, stored)
    except (BadFile, KeyError, TypeError, ValueError, IndexError) as error:
        case.tally.expect("histogram", place, False, f"cannot be read: {error}")
        return
    for name, same in numbers.items():
        case.tally.expect("histogram", place, same, f"{name} is not that of the pictures")


def _compare(case: ViewCase, stored: dict[str, Any]) -> dict[str, bool]:
    """Number of histogram.json -> it is right."""
    view, arrays = case.view, case.arrays
    settings, same = stored["settings"], {}
    same["format"] = stored["format"] == "pbrs_farm histogram 1"
    place = stored["house"], stored["view"], stored["room"]
    same["place"] = place == tuple(view.table[k] for k in ("house", "view", "room"))
    sizes = {row["size"] for row in stored["colour"].values()}
    same["sizes"] = stored["depth"]["size"] == settings["depth_bins"]
    same["sizes"] &= sizes <= {settings["colour_bins"] ** 3}
    if view.recipe is not None:
        same["settings"] = settings == view.recipe.histogram.model_dump(mode="json")
    modes = [m for m in _MODES if m in arrays]
    counted = ["mlt_il_ol"] if "mlt_il_ol" in modes else modes
    same["modes"] = set(stored["picture"]) == set(modes) and set(stored["colour"]) == set(counted)
    for mode in counted:
        same[f"colour of {mode}"] = _same_colours(arrays[mode], stored["colour"][mode], settings)
    # Depth: equal bins between the ends, unknown left out.
    mm = arrays["depth"][arrays["depth"] > 0].astype(float)
    low, high, n = (settings[k] for k in ("depth_min_m", "depth_max_m", "depth_bins"))
    bins = np.clip(np.floor((mm - low * 1000) * (n / (high * 1000 - low * 1000))), 0, n - 1)
    counts = np.bincount(bins.astype(int), minlength=n)
    same["depth"] = bool((_dense(stored["depth"]) == counts).all())
    for mode in modes:
        picture, numbers = arrays[mode], stored["picture"][mode]
        luma = np.floor(picture[::2, ::2].astype(float) @ [54, 183, 19] / 256)
        median = np.sort(luma.reshape(-1))[(luma.size + 1) // 2 - 1]
        blown = float((picture.max(axis=-1) >= 254).mean())
        same[f"brightness of {mode}"] = abs(numbers["brightness"] - median / 255) < 1e-4
        same[f"share blown of {mode}"] = abs(numbers["blown"] - blown) < 1e-4
    return same | _compare_scene(case, stored["scene"], settings)


def _compare_home(case: ViewCase, stored: dict[str, Any]) -> dict[str, bool]:
    """The room's name, and the number of the home's missing pictures."""
    house = case.house.house
    if not house:
        return {}
    names = {room["id"]: room["name"] for room in house["rooms"]}
    lacking = sum(n["kind"] in ("missing-texture", "unreadable-texture") for n in house["notes"])
    return {
        "room_type": stored["room_type"] == names.get(stored["room"], ""),
        "missing_textures": stored["scene"]["missing_textures"] == lacking,
    }


def _same_colours(picture: NDArray[Any], stored: dict[str, Any], settings: dict[str, Any]) -> bool:
    n = int(settings["colour_bins"])
    rgb = picture.astype(float)
    slack = 0
    if settings["colour_space"] == "ycbcr":
        # BT.601 of full range; its rounding puts a few pixels into the next bin.
        y = rgb @ [0.299, 0.587, 0.114]
        chroma = [128 + (rgb[..., 2] - y) / 1.772, 128 + (rgb[..., 0] - y) / 1.402]
        rgb = np.clip(np.rint(np.stack([y, *chroma], axis=-1)), 0, 255)
        slack = int(0.02 * picture[..., 0].size)
    cell = np.floor(rgb * n / 256).astype(int)
    index = (cell[..., 0] * n + cell[..., 1]) * n + cell[..., 2]
    counts = np.bincount(index.reshape(-1), minlength=n**3)
    return int(np.abs(_dense(stored) - counts).sum()) <= slack


def _dense(stored: dict[str, Any]) -> I64:
    counts = np.zeros(int(stored["size"]), np.int64)
    counts[np.array(stored["bins"], np.int64)] = stored["counts"]
    return counts


def _compare_scene(
    case: ViewCase, scene: dict[str, Any], settings: Mapping[str, Any]
) -> dict[str, bool]:
    """Number of the histogram's "scene" -> it is right."""
    rows, depth = case.view.table["instances"], case.arrays["depth"]
    objects = [r for r in rows if not ItemKind(r["kind"]).is_structure]
    near = float(((depth > 0) & (depth < settings["near_m"] * 1000)).mean())
    surface = max((float(row["fraction"]) for row in rows), default=0.0)
    n_objects = sum(r["fraction"] >= settings["object_fraction"] for r in objects)
    classes: dict[str, float] = {}
    for row in rows:
        if row["nyu40"] > 0:
            key = str(row["nyu40"])
            classes[key] = classes.get(key, 0.0) + float(row["fraction"])
    noise = case.view.table.get("modes", {}).get("light", {}).get("noise")
    noise = noise.get("sum") if isinstance(noise, dict) else noise
    same_classes = scene["classes"].keys() == classes.keys()
    return {
        "surface": abs(scene["surface"] - surface) < 1e-4,
        "near": abs(scene["near"] - near) < 1e-4,
        "n_objects": scene["n_objects"] == n_objects,
        "classes": same_classes
        and all(abs(scene["classes"][k] - v) < 1e-3 for k, v in classes.items()),
        "noise": (noise is None) == (scene["noise"] is None)
        and (noise is None or abs(scene["noise"] - noise) < 1e-4),
    }


CHECKS = (
    Check("pictures", "view", check_pictures, 11),
    Check("layers", "view", check_consistency, 12),
    Check("planes", "view", check_planes, 13),
    Check(
        "typed boundaries",
        "view",
        check_typed_boundaries,
        14,
        ("boundary_occlusion", "boundary_crease"),
    ),
    Check("opengl edges", "view", check_edges, 60, ("opengl_dl", "opengl_il")),
    Check("histogram", "view", check_histogram, 70, ("histogram.json",)),
)
