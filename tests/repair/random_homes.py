"""Random homes by seed: odd corners, overlaps, shells, names with terminal control characters."""

from __future__ import annotations

import math
from collections.abc import Callable
from xml.sax.saxutils import quoteattr

import numpy as np

from tests.read.gltf.gltf_scenes import CUBE, Scene
from tests.read.sweethome3d.sh3d_source import BOX_OBJ, WINDOW_OBJ, home_xml, sh3d

Point = tuple[float, float]

NAMES = (
    "Hall", "A\n[   0.1 s] forged", "\u202eevil\u202c", "居間", "سالن", "x" * 100_000, "", "a\u0301" * 40,
    "fenster 1.3m oknó", "Wall window floor ceiling", "CON", "../../up", "\x7f\x9b31m", "\U0001f6aa",
)  # fmt: skip
"""For rooms, pieces and nodes: newlines, writing directions, accents, lengths, words of other items."""

ODD_WINDOWS = ("Fenster_03", "okno.glass", "WINDOWLESS door", "窓", "Pane#2", "Mullion window.001")


def random_home(seed: int) -> tuple[str, bytes]:
    """(file name, bytes) of a home; the four kinds of fault alternate, with parameters from the seed."""
    rng = np.random.default_rng(seed)
    kinds: tuple[Callable[[np.random.Generator], bytes], ...] = (
        _cornered,
        _overlapping,
        _fan,
        _shells,
    )
    kind = kinds[seed % len(kinds)]
    return f"home{seed}.{'sh3d' if kind in (_cornered, _overlapping) else 'glb'}", kind(rng)


def _star(rng: np.random.Generator, n: int) -> list[Point]:
    """A star-shaped polygon of n corners about the origin, radius 1.2 to 3.5 m."""
    angles = 2 * math.pi * (np.arange(n) + rng.uniform(-0.3, 0.3, n)) / n
    radii = rng.uniform(1.2, 3.5, n)
    return [(float(r * math.cos(a)), float(r * math.sin(a))) for r, a in zip(radii, angles)]


def _name(rng: np.random.Generator, names: tuple[str, ...] = NAMES) -> str:
    return names[int(rng.integers(len(names)))]


def _xml_name(rng: np.random.Generator) -> str:
    # XML holds no control characters except line ends.
    text = "".join(c for c in _name(rng) if c == "\n" or c.isprintable() or ord(c) > 0x9F)
    return quoteattr(text)


def _walls(
    rng: np.random.Generator, corners: list[Point], first: int, *, joined: bool = True
) -> str:
    n, text, thickness = len(corners), "", rng.uniform(4, 30)
    for k, ((x0, y0), (x1, y1)) in enumerate(zip(corners, [*corners[1:], corners[0]], strict=True)):
        ends = f"wallAtStart='w{first + (k - 1) % n}' wallAtEnd='w{first + (k + 1) % n}'"
        text += (
            f"<wall id='w{first + k}' {ends if joined else ''} xStart='{x0:.3f}' yStart='{y0:.3f}'"
            f" xEnd='{x1:.3f}' yEnd='{y1:.3f}' thickness='{thickness:.2f}'/>"
        )
    return text


def _room(rng: np.random.Generator, corners: list[Point]) -> str:
    points = "".join(f"<point x='{x:.3f}' y='{y:.3f}'/>" for x, y in corners)
    return f"<room name={_xml_name(rng)}>{points}</room>"


def _pieces(rng: np.random.Generator, n: int) -> str:
    text = ""
    for k in range(n):
        x, y = rng.uniform(300, 500, 2)
        text += (
            f"<pieceOfFurniture id='p{k}' name={_xml_name(rng)} model='box' x='{x:.2f}' y='{y:.2f}'"
            f" angle='{rng.uniform(0, 6.3):.3f}' width='50' depth='40' height='{rng.uniform(30, 200):.1f}'/>"
        )
    return text


def _opening(rng: np.random.Generator, a: Point, b: Point, index: int) -> str:
    # In the middle of a wall, turned with it, sometimes wider or thinner.
    angle = math.atan2(b[1] - a[1], b[0] - a[0])
    return (
        f"<doorOrWindow id='o{index}' name={quoteattr(_name(rng, ODD_WINDOWS))} model='window'"
        f" x='{(a[0] + b[0]) / 2:.3f}' y='{(a[1] + b[1]) / 2:.3f}' angle='{angle:.6f}'"
        f" width='{rng.uniform(40, 160):.1f}' depth='{rng.uniform(5, 40):.1f}'"
        f" height='{rng.uniform(60, 220):.1f}' elevation='{rng.uniform(0, 120):.1f}'/>"
    )


def _cornered(rng: np.random.Generator) -> bytes:
    """One room with odd corners and windows."""
    corners = [(100 * x + 400, 100 * y + 400) for x, y in _star(rng, int(rng.integers(3, 12)))]
    body = _walls(rng, corners, 0, joined=bool(rng.integers(2))) + _pieces(rng, 4)
    for k in range(int(rng.integers(0, 3))):
        body += _opening(rng, corners[k], corners[k + 1], k)
    contents = {"box": BOX_OBJ, "window": WINDOW_OBJ}
    return sh3d(home_xml(body, room=_room(rng, corners)), contents)


def _overlapping(rng: np.random.Generator) -> bytes:
    """A large room, and smaller ones inside or across its outline, with separate partitions."""
    box: list[Point] = [(0, 0), (800, 0), (800, 600), (0, 600)]
    rooms, body = _room(rng, box), _walls(rng, box, 0)
    for k in range(int(rng.integers(1, 4))):
        width, depth = rng.uniform(150, 350, 2)
        x, y = rng.uniform(0, 800 - width / 2), rng.uniform(0, 600 - depth / 2)
        inner: list[Point] = [(x, y), (x + width, y), (x + width, y + depth), (x, y + depth)]
        rooms += _room(rng, inner)
        body += _walls(rng, inner, 10 * (k + 1))
    body += _pieces(rng, 4) + _opening(rng, box[0], box[1], 0)
    return sh3d(home_xml(body, room=rooms), {"box": BOX_OBJ, "window": WINDOW_OBJ})


def _fan(rng: np.random.Generator) -> bytes:
    """A room of open sheets; floor and ceiling are fans of triangles around the middle or a corner."""
    s, corners = Scene(), _star(rng, int(rng.integers(3, 12)))
    for name, y in (("Floor", 0.0), ("Ceiling", float(rng.uniform(2.0, 3.2)))):
        ring = [[x, y, z] for x, z in corners]
        s.node(
            name,
            mesh=_fan_mesh(s, ring if name == "Ceiling" else ring[::-1], bool(rng.integers(2))),
        )
        height = y
    sides = [
        [[a[0], 0, a[1]], [b[0], 0, b[1]], [b[0], height, b[1]], [a[0], height, a[1]]]
        for a, b in zip(corners, [*corners[1:], corners[0]], strict=True)
    ]
    sides_left = [side for side in sides if rng.random() > 0.1]
    s.node("Walls", mesh=s.mesh(sides_left or sides))
    s.node(_name(rng), mesh=s.box([-0.3, 0, -0.3], [0.3, 0.8, 0.3]))
    s.node(_name(rng, ODD_WINDOWS), mesh=s.box([0.4, 0.9, -0.05], [1.2, 2.0, 0.05]))
    return s.glb()


def _fan_mesh(s: Scene, ring: list[list[float]], from_middle: bool) -> int:
    n, first = len(ring), 1 if from_middle else 0
    points = [np.mean(ring, axis=0).tolist(), *ring] if from_middle else ring
    numbers = range(n) if from_middle else range(1, n - 1)
    faces = [[0, first + k, first + (k + 1) % n] for k in numbers]
    positions = s.writer.add_vertices(np.array(points, np.float32), with_bounds=True)
    indices = s.writer.add_faces(np.array(faces, np.int32))
    s.meshes.append({"primitives": [{"attributes": {"POSITION": positions}, "indices": indices}]})
    return len(s.meshes) - 1


def _shells(rng: np.random.Generator) -> bytes:
    """Rooms of one box each, seen from inside or outside, separate, touching or overlapping."""
    s = Scene()
    for k in range(int(rng.integers(1, 4))):
        size = rng.uniform([2.0, 2.2, 2.0], [6.0, 3.2, 6.0])
        box = np.array(CUBE, np.float64) * size + [
            2.0 * k * rng.integers(2),
            0,
            float(rng.integers(3)),
        ]
        quads = box[:, ::-1] if not k or rng.random() < 0.7 else box
        s.node(f"Room{k} floor walls ceiling {_name(rng)[:60]}", mesh=s.mesh(quads.tolist()))
    for k in range(3):
        s.node(_name(rng), mesh=s.box([0.5 + k, 0, 1], [0.9 + k, 0.8, 1.4]))
    return s.glb()
