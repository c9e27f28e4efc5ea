"""OBJ and MTL text in SUNCG's style, for synthetic roots; no effects."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

Triple = tuple[float, float, float]


@dataclass
class Obj:
    """Collects quads and writes them as SUNCG does: 1-based `f v/vt/vn`, a leading space."""

    mtllib: str
    lines: list[str] = field(default_factory=list)
    n: int = 0

    def begin(self, *, group: str = "", material: str) -> None:
        if group:
            self.lines.append(f"o {group}")
        self.lines.append(f"usemtl {material}")

    def quad(self, corners: list[Triple]) -> None:
        """Four corners, counter-clockwise from the front; uv in metres."""
        p = np.array(corners, np.float64)
        u, v = p[1] - p[0], p[3] - p[0]
        normal = np.cross(u, v)
        normal /= np.linalg.norm(normal)
        lengths = np.linalg.norm(u), np.linalg.norm(v)
        uvs = [(0, 0), (lengths[0], 0), (lengths[0], lengths[1]), (0, lengths[1])]
        for corner, uv in zip(p, uvs, strict=True):
            self.lines.append("v {:.9g} {:.9g} {:.9g}".format(*corner))
            self.lines.append("vt {:.9g} {:.9g}".format(*uv))
            self.lines.append("vn {:.9g} {:.9g} {:.9g}".format(*normal))
        self.lines.append(
            " f " + " ".join(f"{self.n + k}/{self.n + k}/{self.n + k}" for k in (1, 2, 3, 4))
        )
        self.n += 4

    def box(self, low: Triple, high: Triple) -> None:
        """Six outward quads."""
        (x0, y0, z0), (x1, y1, z1) = low, high
        for corners in (
            [(x1, y0, z1), (x1, y0, z0), (x1, y1, z0), (x1, y1, z1)],
            [(x0, y0, z0), (x0, y0, z1), (x0, y1, z1), (x0, y1, z0)],
            [(x0, y1, z1), (x1, y1, z1), (x1, y1, z0), (x0, y1, z0)],
            [(x0, y0, z0), (x1, y0, z0), (x1, y0, z1), (x0, y0, z1)],
            [(x0, y0, z1), (x1, y0, z1), (x1, y1, z1), (x0, y1, z1)],
            [(x1, y0, z0), (x0, y0, z0), (x0, y1, z0), (x1, y1, z0)],
        ):
            self.quad(corners)

    def text(self) -> str:
        return "\n".join([f"mtllib {self.mtllib}", *self.lines]) + "\n"


def mtl(*materials: dict[str, str]) -> str:
    """newmtl blocks, keys in the given order."""
    blocks = []
    for material in materials:
        keys = dict(material)
        blocks.append(f"newmtl {keys.pop('name')}")
        blocks += [f"{key} {value}" for key, value in keys.items()]
        blocks.append("")
    return "\n".join(blocks)


def ball(obj: Obj, centre: Triple, radius: float, n: int) -> None:
    """A ball of n x n quads over shared vertices, smooth (quads at the poles are triangles)."""
    first = obj.n + 1
    for i in range(n + 1):
        polar = np.pi * i / n
        for j in range(n + 1):
            around = 2 * np.pi * j / n
            ring = np.sin(polar)
            normal = np.array([ring * np.sin(around), -np.cos(polar), ring * np.cos(around)])
            obj.lines.append("v {:.9g} {:.9g} {:.9g}".format(*(normal * radius + centre)))
            obj.lines.append(f"vt {j / n:.6g} {i / n:.6g}")
            obj.lines.append("vn {:.6g} {:.6g} {:.6g}".format(*normal))
            obj.n += 1
    for i in range(n):
        for j in range(n):
            k = first + i * (n + 1) + j
            corners = (k, k + 1, k + n + 2, k + n + 1)
            obj.lines.append("f " + " ".join(f"{c}/{c}/{c}" for c in corners))


Hole = tuple[float, float, float, float]
"""(along from, along to, height from, height to), metres."""


def slab_with_holes(
    obj: Obj,
    start: tuple[float, float],
    along: tuple[float, float],
    outward: tuple[float, float],
    length: float,
    height: float,
    across: tuple[float, float],
    holes: list[Hole],
    *,
    group: str,
    face: str,
    edge: str,
) -> None:
    """One closed slab of a wall between two distances outward, cut by rectangular holes."""
    ss = sorted({0.0, length, *(x for h in holes for x in h[:2])})
    ys = sorted({0.0, height, *(min(max(y, 0.0), height) for h in holes for y in h[2:])})

    def at(s: float, y: float, d: float) -> Triple:
        return (
            start[0] + along[0] * s + outward[0] * d,
            y,
            start[1] + along[1] * s + outward[1] * d,
        )

    def is_solid(i: int, j: int) -> bool:
        if not (0 <= i < len(ss) - 1 and 0 <= j < len(ys) - 1):
            return False
        s, y = (ss[i] + ss[i + 1]) / 2, (ys[j] + ys[j + 1]) / 2
        return not any(a < s < b and c < y < d for a, b, c, d in holes)

    near, far = across
    faces: list[list[Triple]] = []
    edges: list[list[Triple]] = []
    for i in range(len(ss) - 1):
        for j in range(len(ys) - 1):
            if not is_solid(i, j):
                continue
            a, b, c, d = ss[i], ss[i + 1], ys[j], ys[j + 1]
            faces.append([at(a, c, near), at(b, c, near), at(b, d, near), at(a, d, near)])
            faces.append([at(b, c, far), at(a, c, far), at(a, d, far), at(b, d, far)])
            if not is_solid(i - 1, j):
                edges.append([at(a, c, far), at(a, c, near), at(a, d, near), at(a, d, far)])
            if not is_solid(i + 1, j):
                edges.append([at(b, c, near), at(b, c, far), at(b, d, far), at(b, d, near)])
            if not is_solid(i, j - 1):
                edges.append([at(a, c, far), at(b, c, far), at(b, c, near), at(a, c, near)])
            if not is_solid(i, j + 1):
                edges.append([at(a, d, near), at(b, d, near), at(b, d, far), at(a, d, far)])
    # With the winding above, the face looks into the room if along x up points away from it.
    turn = along[1] * outward[0] - along[0] * outward[1] > 0
    obj.begin(group=group, material=face)
    for corners in faces:
        obj.quad(corners if turn else corners[::-1])
    obj.begin(material=edge)
    for corners in edges:
        obj.quad(corners if turn else corners[::-1])
