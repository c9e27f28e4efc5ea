"""OpenUSD homes written with the library, in the style of robots' simulators. Effects: writes files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdLux, UsdShade, Vt

HEIGHT = 2.6
THICK = 0.12


class UsdHome:
    """A stage under construction: z up, a custom unit, lengths given in metres."""

    def __init__(self, path: Path, metres_per_unit: float = 1.0, up: str = "Z") -> None:
        self.path, self.unit = path, metres_per_unit
        self.is_z_up = up == "Z"
        self.stage = Usd.Stage.CreateNew(str(path))
        UsdGeom.SetStageMetersPerUnit(self.stage, metres_per_unit)
        UsdGeom.SetStageUpAxis(self.stage, up)
        self.root = UsdGeom.Xform.Define(self.stage, "/World")
        self.stage.SetDefaultPrim(self.root.GetPrim())

    def save(self) -> Path:
        self.stage.GetRootLayer().Save()
        return self.path

    def points(self, world: Any) -> Any:
        """World points (metres, y up) in the stage's axes and unit."""
        p = np.asarray(world, np.float64).reshape(-1, 3) / self.unit
        if self.is_z_up:
            p = np.column_stack([p[:, 0], -p[:, 2], p[:, 1]])
        return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(p, np.float32))

    def quads(self, path: str, quads: Any, label: str = "", material: Any = None) -> Any:
        """A mesh of quads (N, 4, 3), world; uv 0..1 on each, unshared corners."""
        mesh = UsdGeom.Mesh.Define(self.stage, path)
        p = np.asarray(quads, np.float64).reshape(-1, 4, 3)
        mesh.CreatePointsAttr(self.points(p))
        mesh.CreateFaceVertexCountsAttr([4] * len(p))
        mesh.CreateFaceVertexIndicesAttr(list(range(4 * len(p))))
        mesh.CreateSubdivisionSchemeAttr("none")
        st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
            "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying
        )
        st.Set([Gf.Vec2f(*uv) for _ in p for uv in ((0, 0), (1, 0), (1, 1), (0, 1))])
        if label:
            set_label(mesh.GetPrim(), label)
        if material is not None:
            UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
        return mesh

    def box(self, path: str, low: Any, high: Any, label: str = "", material: Any = None) -> Any:
        return self.quads(path, box_quads(low, high), label, material)

    def material(self, name: str, rgb: Any = (0.6, 0.6, 0.6), **inputs: Any) -> Any:
        """A UsdPreviewSurface; inputs: of the shader; picture: a file beside, is_cut: by its alpha."""
        material = UsdShade.Material.Define(self.stage, f"/World/Looks/{name}")
        shader = UsdShade.Shader.Define(self.stage, f"/World/Looks/{name}/Shader")
        shader.CreateIdAttr("UsdPreviewSurface")
        colour = shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f)
        picture = inputs.pop("picture", None)
        if picture is None:
            colour.Set(Gf.Vec3f(*rgb))
        else:
            reader = UsdShade.Shader.Define(self.stage, f"/World/Looks/{name}/St")
            reader.CreateIdAttr("UsdPrimvarReader_float2")
            reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
            node = UsdShade.Shader.Define(self.stage, f"/World/Looks/{name}/Picture")
            node.CreateIdAttr("UsdUVTexture")
            node.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(Sdf.AssetPath(picture))
            st = reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
            node.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(st)
            colour.ConnectToSource(node.CreateOutput("rgb", Sdf.ValueTypeNames.Float3))
            if inputs.pop("is_cut", False):
                opacity = shader.CreateInput("opacity", Sdf.ValueTypeNames.Float)
                opacity.ConnectToSource(node.CreateOutput("a", Sdf.ValueTypeNames.Float))
                inputs["opacityThreshold"] = 0.5
        for key, value in inputs.items():
            is_colour = isinstance(value, tuple)
            kind = Sdf.ValueTypeNames.Color3f if is_colour else Sdf.ValueTypeNames.Float
            shader.CreateInput(key, kind).Set(Gf.Vec3f(*value) if is_colour else value)
        surface = shader.CreateOutput("surface", Sdf.ValueTypeNames.Token)
        material.CreateSurfaceOutput().ConnectToSource(surface)
        return material

    def sphere_light(self, path: str, place: Any, radius: float = 0.05) -> Any:
        light = UsdLux.SphereLight.Define(self.stage, path)
        light.CreateRadiusAttr(radius / self.unit)
        light.AddTranslateOp().Set(Gf.Vec3d(*map(float, self.points([place])[0])))
        return light


def set_label(prim: Any, label: str) -> None:
    prim.CreateAttribute("semantics:labels:class", Sdf.ValueTypeNames.TokenArray).Set([label])


def box_quads(low: Any, high: Any) -> Any:
    """(6, 4, 3) quads of a box with outward faces."""
    cube = [
        [[1, 0, 1], [1, 0, 0], [1, 1, 0], [1, 1, 1]], [[0, 0, 0], [0, 0, 1], [0, 1, 1], [0, 1, 0]],
        [[0, 1, 1], [1, 1, 1], [1, 1, 0], [0, 1, 0]], [[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]],
        [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], [[1, 0, 0], [0, 0, 0], [0, 1, 0], [1, 1, 0]],
    ]  # fmt: skip
    a, b = np.asarray(low, float), np.asarray(high, float)
    return np.array(cube) * (b - a) + a


def walls_of(home: UsdHome, scope: str, x0: float, x1: float, z0: float, z1: float) -> None:
    """Four walls around a room, faces inwards, the wall at z1 with a window's hole in it."""
    mid, h = (x0 + x1) / 2, HEIGHT
    a, b, sill, top = mid - 0.6, mid + 0.6, 0.9, 2.1
    sides = {
        "Wall_north": [[[x0, 0, z0], [x1, 0, z0], [x1, h, z0], [x0, h, z0]]],
        "Wall_west": [[[x0, 0, z1], [x0, 0, z0], [x0, h, z0], [x0, h, z1]]],
        "Wall_east": [[[x1, 0, z0], [x1, 0, z1], [x1, h, z1], [x1, h, z0]]],
        "Wall_south": [
            [[a, 0, z1], [x0, 0, z1], [x0, h, z1], [a, h, z1]],
            [[x1, 0, z1], [b, 0, z1], [b, h, z1], [x1, h, z1]],
            [[b, 0, z1], [a, 0, z1], [a, sill, z1], [b, sill, z1]],
            [[b, top, z1], [a, top, z1], [a, h, z1], [b, h, z1]],
        ],
    }  # fmt: skip
    for name, quads in sides.items():
        home.quads(f"{scope}/{name}", quads, "wall")
    floor = [[[x0, 0, z1], [x1, 0, z1], [x1, 0, z0], [x0, 0, z0]]]
    home.quads(f"{scope}/Floor", floor, "floor")
    ceiling = [[[x0, h, z0], [x1, h, z0], [x1, h, z1], [x0, h, z1]]]
    home.quads(f"{scope}/Ceiling", ceiling, "ceiling")
    window = UsdGeom.Xform.Define(home.stage, f"{scope}/Window_1")
    set_label(window.GetPrim(), "window")
    pane = home.material("Glass", (0.9, 0.95, 1.0), opacity=0.2, roughness=0.0)
    home.box(f"{scope}/Window_1/Pane", [a, sill, z1 - 0.005], [b, top, z1 + 0.005], "", pane)


def realistic_home(path: Path, n_triangles: int = 300_000, n_rooms: int = 6) -> Path:
    """Rooms in a row, each with lamps and furniture of many triangles, a third of it instances."""
    home = UsdHome(path, 0.01)
    names = ("LivingRoom", "Kitchen", "Bedroom", "Bathroom", "Study", "Hallway")
    labels = ("sofa", "table", "chair", "bed", "cabinet", "bookshelf", "plant", "television")
    each = max(n_triangles // (n_rooms * len(labels) * 2), 8)
    side = max(int(np.sqrt(each)), 2)
    mesh = _ball(side)
    for k in range(n_rooms):
        scope = f"/World/{names[k % len(names)]}_{k}"
        x0 = 5.0 * k
        UsdGeom.Xform.Define(home.stage, scope)
        walls_of(home, scope, x0, x0 + 4.8, 0.0, 4.0)
        home.sphere_light(f"{scope}/Lamp", [x0 + 2.4, 2.3, 2.0])
        for j, label in enumerate(labels):
            prim = UsdGeom.Xform.Define(home.stage, f"{scope}/{label}_{j}")
            Usd.ModelAPI(prim).SetKind(Kind.Tokens.component)
            set_label(prim.GetPrim(), label)
            centre = np.array([x0 + 0.6 + 1.1 * (j % 4), 0.4, 0.8 + 1.6 * (j // 4)])
            _add_ball(home, f"{scope}/{label}_{j}/Body", mesh, centre, 0.4)
    return home.save()


def _ball(side: int) -> tuple[Any, Any]:
    """(points, triangles) of a unit ball."""
    u, v = np.linspace(0, 2 * np.pi, side, endpoint=False), np.linspace(0.01, np.pi - 0.01, side)
    uu, vv = np.meshgrid(u, v, indexing="ij")
    points = np.stack([np.cos(uu) * np.sin(vv), np.cos(vv), np.sin(uu) * np.sin(vv)], -1)
    i, j = np.meshgrid(np.arange(side), np.arange(side - 1), indexing="ij")
    a, b = i * side + j, (i + 1) % side * side + j
    faces = np.stack([np.stack([a, b, b + 1], -1), np.stack([a, b + 1, a + 1], -1)], -2)
    return points.reshape(-1, 3), faces.reshape(-1, 3)


def _add_ball(home: UsdHome, path: str, ball: tuple[Any, Any], centre: Any, radius: float) -> None:
    points, faces = ball
    mesh = UsdGeom.Mesh.Define(home.stage, path)
    mesh.CreatePointsAttr(home.points(points * radius + centre))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(faces), 3, np.int32)))
    indices = np.ascontiguousarray(faces.ravel(), np.int32)
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(indices))
    mesh.CreateSubdivisionSchemeAttr("none")
