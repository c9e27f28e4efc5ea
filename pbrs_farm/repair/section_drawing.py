"""A horizontal cut through the walls before and after repair, as SVG text; no effects."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.core.house import House, Item, ItemKind, corners_of_surfaces
from pbrs_farm.core.svg import Element, element, svg_file, svg_text

_CUT_M = 1.2  # above the level's floor
_WIDTH_PX = 1600
_GAP_M = 1.0  # between the two panels
_TEXT_M = 0.25  # height of letters


def section_svg(before: House, after: House, level_id: str) -> str:
    """Side by side: wall outlines before and solid walls after, in plan, one unit per metre."""
    # Section wall by wall before repair, the whole structure together after it.
    y = before.level(level_id).elevation + _CUT_M
    parts = [section_of_items([i], y) for i in before.items if i.kind is ItemKind.WALL]
    solid = section_of_items([i for i in after.items if i.kind.is_structure], y)
    everything = np.concatenate([np.zeros((0, 2, 2)), *parts, solid]).reshape(-1, 2)
    if not len(everything):
        everything = np.array([[0.0, 0.0], [1.0, 1.0]])
    # Frame both panels alike, half a metre around.
    low, high = everything.min(0) - 0.5, everything.max(0) + 0.5
    size = high - low
    total = 2 * size[0] + _GAP_M
    height_px = round(_WIDTH_PX * size[1] / total)
    box = f"0 0 {total:.3f} {size[1]:.3f}"
    root = svg_file(width=_WIDTH_PX, height=height_px, viewBox=box)
    element(root, "rect", width="100%", height="100%", fill="white")
    panel = _panel(root, "before", low)
    for segments in parts:
        _draw_walls(panel, segments, fill="#c98b4a", fill_opacity="0.45", stroke="#5a3210")
    right = element(root, "g", transform=f"translate({size[0] + _GAP_M:.3f} 0)")
    _draw_walls(_panel(right, "after", low), solid, fill="#3d3d3d", fill_opacity="1", stroke="none")
    return svg_text(root) + "\n"


def _panel(parent: Element, title: str, low: F64) -> Element:
    element(parent, "text", title, x=0.2, y=0.35, font_size=_TEXT_M, font_family="sans-serif")
    return element(parent, "g", transform=f"translate({-low[0]:.3f} {-low[1]:.3f})")


def _draw_walls(panel: Element, segments: F64, **style: str) -> None:
    # Fill a closed cut; draw an open one, of a planar wall, as a red line.
    polygons = solid_polygons(segments)
    if polygons:
        rings = [r for p in polygons for r in (p.exterior, *p.interiors)]
        d = "".join("M" + "L".join(_xy(c) for c in r.coords[:-1]) + "Z" for r in rings)
        element(panel, "path", d=d, fill_rule="evenodd", **style, stroke_width="0.012")
    elif len(segments):
        d = "".join(f"M{_xy(a)}L{_xy(b)}" for a, b in segments)
        element(panel, "path", d=d, fill="none", stroke="#c02020", stroke_width="0.02")


def _xy(point: Sequence[float] | F64) -> str:
    return f"{point[0]:.4f} {point[1]:.4f}"


def section_of_items(items: Sequence[Item], y: float) -> F64:
    """(N, 2, 2) plan segments (x, z) where the items' triangles cross the height y."""
    corners = corners_of_surfaces(s for i in items for s in i.surfaces)
    # Keep the triangles with corners on both sides of the cut.
    above = corners[:, :, 1] > y
    crossing = above.any(1) & ~above.all(1)
    corners, above = corners[crossing], above[crossing]

    # Turn each triangle so that corner 0 is alone on its side of the cut.
    alone = np.where(above.sum(1, keepdims=True) == 1, above, ~above).argmax(1)
    order = (alone[:, None] + np.arange(3)) % 3
    a, b, c = np.moveaxis(np.take_along_axis(corners, order[:, :, None], 1), 1, 0)
    # Intersect the two edges that leave that corner.
    ends = [_meet(a, b, y), _meet(a, c, y)]
    return np.stack(ends, 1)[:, :, [0, 2]]


def _meet(a: F64, b: F64, y: float) -> F64:
    t = (y - a[:, 1]) / (b[:, 1] - a[:, 1])
    return np.asarray(a + t[:, None] * (b - a))


def solid_polygons(segments: F64) -> list[shapely.Polygon]:
    """Solid regions of a closed section (N, 2, 2), an odd number of edges to their right; open ones dropped."""
    if not len(segments):
        return []
    # Snap to 10 micrometres, so that segments of neighbours share their ends.
    snapped = np.round(segments, 5)
    lines = shapely.linestrings(snapped[(snapped[:, 0] != snapped[:, 1]).any(1)])
    # Split the lines where they cross and collect the cells between them.
    noded = shapely.union_all(lines, grid_size=1e-5)
    cells = shapely.get_parts(shapely.polygonize(shapely.get_parts(noded)))
    return [c for c in cells.tolist() if _is_odd(_inner_point(c), snapped)]


def _inner_point(cell: shapely.Polygon) -> F64:
    point = shapely.point_on_surface(cell)
    return np.array([point.x, point.y])


def _is_odd(point: F64, segments: F64) -> bool:
    a, b = segments[:, 0] - point, segments[:, 1] - point
    # Count the segments that a ray towards +x crosses.
    crosses: Bools = (a[:, 1] > 0) != (b[:, 1] > 0)
    a, b = a[crosses], b[crosses]
    x = a[:, 0] - a[:, 1] * (b[:, 0] - a[:, 0]) / (b[:, 1] - a[:, 1])
    return bool((x > 0).sum() % 2)
