"""A home as an OpenUSD stage for Isaac Sim and others. Effects: writes files.

Metres, z up, a component an item with its class as a label, UsdPreviewSurface, UsdPhysics, UsdLux.
`pbrs-farm run` reads it back: items, classes, boxes, rooms and the flux of lamps are the same.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any, Final

import numpy as np
from scipy.spatial.transform import Rotation

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import Z_UP_FROM_Y_UP
from pbrs_farm.core.house import USUAL_CUTOFF, House, ItemKind, MaterialKind, Surface
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.export.form import HomeForm
from pbrs_farm.export.home_bodies import effort_of
from pbrs_farm.export.home_pieces import COLLIDES, ExportedHome, Lamp, Piece, rooms_json
from pbrs_farm.export.passing import End, passing_pairs
from pbrs_farm.formats.house_glb import GLTF_IMAGES, gltf_material, item_extras
from pbrs_farm.geometry.convex_parts import hull_faces
from pbrs_farm.installation import need

_SUFFIXES: Final = {"image/png": ".png", "image/jpeg": ".jpg"}
_LEAST_RADIUS_M: Final = 0.005


def write_usd(home: ExportedHome, folder: Path) -> None:
    """<house id>.usdc and textures/.

    Needs the module pxr. folder must exist.
    """
    need("pxr")
    textures = _write_textures(home.house, folder)
    _Stage(home, folder / f"{home.house.id}.usdc", textures).save()


def _write_textures(house: House, folder: Path) -> dict[str, str]:
    """Texture id -> its file's name, relative to the stage."""
    files = {}
    for key, texture in house.textures.items():
        if texture.media_type not in GLTF_IMAGES:
            continue
        (folder / "textures").mkdir(exist_ok=True)
        name = f"textures/{key}{_SUFFIXES[texture.media_type]}"
        (folder / name).write_bytes(texture.data)
        files[key] = f"./{name}"
    return files


class _Stage:
    """A home's stage while it is written."""

    def __init__(self, home: ExportedHome, path: Path, textures: dict[str, str]) -> None:
        from pxr import Kind, Sdf, Usd, UsdGeom, UsdPhysics

        self._home, self._textures = home, textures
        self._files = list(textures.values())
        self._numbers = {key: k for k, key in enumerate(textures)}
        self._stage = Usd.Stage.CreateNew(str(path))
        UsdGeom.SetStageMetersPerUnit(self._stage, 1.0)
        UsdGeom.SetStageUpAxis(self._stage, UsdGeom.Tokens.z)
        UsdPhysics.SetStageKilogramsPerUnit(self._stage, 1.0)
        if home.credit:
            self._stage.GetRootLayer().customLayerData = {"copyright": home.credit}
        root = UsdGeom.Xform.Define(self._stage, "/Home")
        root.AddTransformOp().Set(_matrix(Z_UP_FROM_Y_UP))
        Usd.ModelAPI(root).SetKind(Kind.Tokens.assembly)
        self._stage.SetDefaultPrim(root.GetPrim())
        attribute = root.GetPrim().CreateAttribute("pbrs:rooms", Sdf.ValueTypeNames.String)
        attribute.Set(json.dumps(rooms_json(home.house), allow_nan=False))
        for scope in ("Items", "Rooms"):
            group = UsdGeom.Xform.Define(self._stage, f"/Home/{scope}")
            Usd.ModelAPI(group).SetKind(Kind.Tokens.group)
        UsdGeom.Scope.Define(self._stage, "/Home/Looks")
        UsdPhysics.Scene.Define(self._stage, "/Home/Physics")

    def save(self) -> None:
        """Write every material, item and room, then the file."""
        looks = {k: self._material(k) for k in self._home.materials}
        for number, piece in enumerate(self._home.pieces):
            self._item(piece, number + 1, looks)
        for pair in passing_pairs(self._home):
            self._let_pass(*pair)
        for k, room in enumerate(self._home.house.rooms):
            self._room(k, room)
        self._stage.GetRootLayer().Save()

    def _item(self, piece: Piece, number: int, looks: dict[int, Any]) -> None:
        from pxr import Kind, Sdf, Usd, UsdGeom, UsdPhysics

        path = f"/Home/Items/{piece.name}"
        xform = UsdGeom.Xform.Define(self._stage, path)
        prim = xform.GetPrim()
        xform.AddTransformOp().Set(_matrix(piece.world_from_local))
        Usd.ModelAPI(xform).SetKind(Kind.Tokens.component)
        prim.SetDisplayName(piece.item.name[:200])
        self._label(prim, piece.class_name)
        extras = item_extras(piece.item, number)
        if self._home.house.is_repaired and piece.item.kind is ItemKind.WALL:
            extras["solid"] = True  # cut by repair: not to be parted by its planes
        if not piece.item.kind.is_structure:
            extras["has_frame"] = True  # its box is along its axes
        attribute = prim.CreateAttribute("pbrs:item", Sdf.ValueTypeNames.String)
        attribute.Set(json.dumps(extras, allow_nan=False))
        if piece.opens:
            self._articulation(piece, path, looks)
        for k, surface in enumerate(() if piece.opens else piece.surfaces):
            mesh = self._mesh(f"{path}/Mesh_{k}", surface, looks[surface.material])
            if piece.is_building:
                # The building is static and collides with its render mesh.
                UsdPhysics.CollisionAPI.Apply(mesh)
                UsdPhysics.MeshCollisionAPI.Apply(mesh).CreateApproximationAttr("none")
        if not piece.is_building and piece.surfaces and not piece.opens:
            self._colliders(piece.colliders, path)
            if not piece.is_fixed:
                UsdPhysics.RigidBodyAPI.Apply(prim)
                UsdPhysics.MassAPI.Apply(prim).CreateMassAttr(piece.mass_kg)
        for k, lamp in enumerate(piece.lamps):
            self._lamp(f"{path}/Light_{k}", lamp, piece.local_from_world)

    def _articulation(self, piece: Piece, path: str, looks: dict[int, Any]) -> None:
        """Add a rigid body for each body of the piece, and the joints between them.

        The articulation's root is the fixed joint of a fixed piece, else the body, as Isaac asks. A part's
        frame is its closed pose, where the joint's value is 0.
        """
        from pxr import Gf, UsdGeom, UsdPhysics

        for k, body in enumerate(piece.bodies):
            body_path = self._body_path(piece, k)
            xform = UsdGeom.Xform.Define(self._stage, body_path)
            xform.AddTransformOp().Set(_matrix(np.asarray(np.linalg.inv(body.shut), np.float64)))
            shape = body.shape(body.shut)
            for n, surface in enumerate(shape.surfaces):
                self._mesh(f"{body_path}/Mesh_{n}", surface, looks[surface.material])
            self._colliders(shape.colliders, body_path)
            UsdPhysics.RigidBodyAPI.Apply(xform.GetPrim())
            UsdPhysics.MassAPI.Apply(xform.GetPrim()).CreateMassAttr(body.mass_kg)
            if body.joint is not None:
                xform.GetPrim().SetDisplayName(body.part[:200])
                self._joint(f"{path}/Joint_{k}", f"{path}/Body", body_path, body.joint)
        root = self._stage.GetPrimAtPath(f"{path}/Body")
        if piece.is_fixed:
            fixed = UsdPhysics.FixedJoint.Define(self._stage, f"{path}/Joint_0")
            fixed.CreateBody1Rel().SetTargets([f"{path}/Body"])
            z_up = Z_UP_FROM_Y_UP @ piece.world_from_local
            fixed.CreateLocalPos0Attr(Gf.Vec3f(*map(float, z_up[:3, 3])))
            fixed.CreateLocalRot0Attr(_quaternion(Rotation.from_matrix(z_up[:3, :3])))
            fixed.CreateLocalPos1Attr(Gf.Vec3f(0, 0, 0))
            fixed.CreateLocalRot1Attr(Gf.Quatf(1, 0, 0, 0))
            root = fixed.GetPrim()
        UsdPhysics.ArticulationRootAPI.Apply(root)

    def _body_path(self, piece: Piece, k: int) -> str:
        """The prim of a piece's k-th body."""
        path = f"/Home/Items/{piece.name}"
        if not piece.opens:
            return path
        return f"{path}/Part_{k}" if k else f"{path}/Body"

    def _let_pass(self, *ends: End) -> None:
        """Exclude two bodies from collision: a part, and a body that it touches without being stopped."""
        from pxr import UsdPhysics

        paths = []
        for number, part in ends:
            piece = self._home.pieces[number]
            k = next(k for k, body in enumerate(piece.bodies) if body.part == part)
            paths.append(self._body_path(piece, k))
        prim = self._stage.GetPrimAtPath(paths[0])
        pairs = UsdPhysics.FilteredPairsAPI.Apply(prim).CreateFilteredPairsRel()
        pairs.AddTarget(paths[1])

    def _joint(self, path: str, body: str, part: str, joint: Joint) -> None:
        from pxr import Gf, UsdPhysics

        is_slide = joint.kind is JointKind.PRISMATIC
        kind = UsdPhysics.PrismaticJoint if is_slide else UsdPhysics.RevoluteJoint
        row = kind.Define(self._stage, path)
        row.CreateBody0Rel().SetTargets([body])
        row.CreateBody1Rel().SetTargets([part])
        row.CreateAxisAttr("X")
        turn = _quaternion(Rotation.align_vectors([joint.axis], [[1.0, 0.0, 0.0]])[0])
        for n in (0, 1):
            getattr(row, f"CreateLocalPos{n}Attr")(Gf.Vec3f(*map(float, joint.point)))
            getattr(row, f"CreateLocalRot{n}Attr")(turn)
        unit = 1.0 if is_slide else float(np.degrees(1))
        row.CreateLowerLimitAttr(joint.lower * unit)
        row.CreateUpperLimitAttr(joint.upper * unit)
        drive = UsdPhysics.DriveAPI.Apply(row.GetPrim(), "linear" if is_slide else "angular")
        drive.CreateDampingAttr(effort_of(joint)[0] / unit)

    def _label(self, prim: Any, name: str) -> None:
        from pxr import Sdf, UsdSemantics

        UsdSemantics.LabelsAPI.Apply(prim, "class").CreateLabelsAttr([name])
        # The older schema, which Isaac Sim reads.
        prim.AddAppliedSchema("SemanticsAPI:Semantics_class")
        for key, value in (("semanticType", "class"), ("semanticData", name)):
            attribute = f"semantic:Semantics_class:params:{key}"
            prim.CreateAttribute(attribute, Sdf.ValueTypeNames.String).Set(value)

    def _mesh(self, path: str, surface: Surface, look: Any) -> Any:
        from pxr import Sdf, UsdGeom, UsdShade, Vt

        mesh = UsdGeom.Mesh.Define(self._stage, path)
        points = np.ascontiguousarray(surface.positions, np.float32)
        mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
        sizes = np.full(len(surface.faces), 3, np.int32)
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(sizes))
        corners = np.ascontiguousarray(surface.faces.ravel(), np.int32)
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(corners))
        mesh.CreateSubdivisionSchemeAttr("none")
        mesh.CreateDoubleSidedAttr(True)
        mesh.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.stack([points.min(0), points.max(0)])))
        if surface.normals is not None:
            normals = np.ascontiguousarray(surface.normals, np.float32)
            mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(normals))
            mesh.SetNormalsInterpolation("vertex")
        if surface.uvs is not None:
            st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
                "st", Sdf.ValueTypeNames.TexCoord2fArray, "vertex"
            )
            st.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(surface.uvs, np.float32)))
        UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(look)
        if self._home.house.materials[surface.material].kind is MaterialKind.BULB:
            # The bulb must not shade the light in it.
            primvars = UsdGeom.PrimvarsAPI(mesh)
            primvars.CreatePrimvar("doNotCastShadows", Sdf.ValueTypeNames.Bool).Set(True)
        return mesh.GetPrim()

    def _colliders(self, parts: tuple[F64, ...], path: str) -> None:
        from pxr import UsdGeom, UsdPhysics, Vt

        for k, part in enumerate(parts):
            triangles = hull_faces(part)
            if not len(triangles):
                continue
            mesh = UsdGeom.Mesh.Define(self._stage, f"{path}/Collider_{k}")
            points = np.ascontiguousarray(part, np.float32)
            mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
            mesh.CreateFaceVertexCountsAttr([3] * len(triangles))
            mesh.CreateFaceVertexIndicesAttr(triangles.ravel().tolist())
            mesh.CreateSubdivisionSchemeAttr("none")
            mesh.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.stack([points.min(0), points.max(0)])))
            mesh.CreatePurposeAttr("guide")  # for physics only
            UsdPhysics.CollisionAPI.Apply(mesh.GetPrim())
            UsdPhysics.MeshCollisionAPI.Apply(mesh.GetPrim()).CreateApproximationAttr("convexHull")

    def _lamp(self, path: str, lamp: Lamp, local_from_world: F64) -> None:
        from pxr import Gf, Sdf, UsdLux

        light = UsdLux.SphereLight.Define(self._stage, path)
        radius = max(float(lamp.radius_m), _LEAST_RADIUS_M)
        light.CreateRadiusAttr(radius)
        # The luminance of a ball that sends out the flux, cd m-2.
        light.CreateIntensityAttr(float(lamp.flux_lm / (4 * np.pi**2 * radius**2)))
        if lamp.is_coloured or min(lamp.rgb_linear) < 1:
            light.CreateColorAttr(Gf.Vec3f(*map(float, lamp.rgb_linear)))
        attribute = light.GetPrim().CreateAttribute("pbrs:lumen", Sdf.ValueTypeNames.Float)
        attribute.Set(float(lamp.flux_lm))
        frame = np.eye(4)
        frame[:3, 3], turn = lamp.placed(local_from_world)
        if lamp.spot and turn is not None:
            frame[:3, :3] = turn.as_matrix()
            shaping = UsdLux.ShapingAPI.Apply(light.GetPrim())
            shaping.CreateShapingConeAngleAttr(float(np.degrees(lamp.spot[1])))
        light.AddTransformOp().Set(_matrix(frame))

    def _room(self, number: int, room: Any) -> None:
        from pxr import UsdGeom, Vt

        name = re.sub(r"[^A-Za-z0-9]+", "_", room.name)[:40].strip("_")
        curve = UsdGeom.BasisCurves.Define(
            self._stage, f"/Home/Rooms/Room_{number}_{name}".rstrip("_")
        )
        plan = np.asarray(room.polygon, np.float64)
        points = np.column_stack([plan[:, 0], np.full(len(plan), room.floor_y), plan[:, 1]])
        curve.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(points, np.float32)))
        curve.CreateCurveVertexCountsAttr([len(points)])
        curve.CreateTypeAttr("linear")
        curve.CreateWrapAttr("periodic")
        curve.CreateWidthsAttr([0.02])
        curve.SetWidthsInterpolation("constant")
        curve.CreatePurposeAttr("guide")
        low, high = points.min(0) - 0.01, points.max(0) + 0.01
        curve.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.stack([low, high]).astype(np.float32)))
        curve.GetPrim().SetDisplayName(room.name[:200])
        self._label(curve.GetPrim(), " ".join(room.types) or room.name or "room")

    def _material(self, number: int) -> Any:
        from pxr import Gf, Sdf, UsdShade

        material = self._home.house.materials[number]
        row = gltf_material(material, self._numbers)
        pbr = row["pbrMetallicRoughness"]
        path = f"/Home/Looks/Material_{number}"
        look = UsdShade.Material.Define(self._stage, path)
        if material.name:
            look.GetPrim().SetDisplayName(material.name)
        attribute = look.GetPrim().CreateAttribute("pbrs:kind", Sdf.ValueTypeNames.Token)
        attribute.Set(row["extras"]["kind"])
        shader = UsdShade.Shader.Define(self._stage, f"{path}/Surface")
        shader.CreateIdAttr("UsdPreviewSurface")
        types = Sdf.ValueTypeNames
        factor = [float(c) for c in pbr["baseColorFactor"]]
        colour = shader.CreateInput("diffuseColor", types.Color3f)
        picture = None
        if "baseColorTexture" in pbr:
            picture = self._picture(f"{path}/Colour", pbr["baseColorTexture"]["index"], "sRGB")
            scale = picture.CreateInput("scale", types.Float4)
            scale.Set(Gf.Vec4f(*factor[:3], 1.0))
            colour.ConnectToSource(picture.CreateOutput("rgb", types.Float3))
        else:
            colour.Set(Gf.Vec3f(*factor[:3]))
        shader.CreateInput("metallic", types.Float).Set(float(pbr["metallicFactor"]))
        roughness = shader.CreateInput("roughness", types.Float)
        if "metallicRoughnessTexture" in pbr:
            map_ = self._picture(
                f"{path}/Roughness", pbr["metallicRoughnessTexture"]["index"], "raw"
            )
            times = float(pbr["roughnessFactor"])
            map_.CreateInput("scale", types.Float4).Set(Gf.Vec4f(times, times, times, 1.0))
            roughness.ConnectToSource(map_.CreateOutput("g", types.Float))
        else:
            roughness.Set(float(pbr["roughnessFactor"]))
        if "normalTexture" in row:
            map_ = self._picture(f"{path}/Normal", row["normalTexture"]["index"], "raw")
            times = float(row["normalTexture"].get("scale", 1.0))
            map_.CreateInput("scale", types.Float4).Set(Gf.Vec4f(2 * times, 2 * times, 2, 1))
            map_.CreateInput("bias", types.Float4).Set(Gf.Vec4f(-times, -times, -1, 0))
            normal = shader.CreateInput("normal", types.Normal3f)
            normal.ConnectToSource(map_.CreateOutput("rgb", types.Float3))
        self._set_opacity(shader, row, picture, factor)
        if "emissiveFactor" in row:
            glow = shader.CreateInput("emissiveColor", types.Color3f)
            glow.Set(Gf.Vec3f(*map(float, row["emissiveFactor"])))
        look.CreateSurfaceOutput().ConnectToSource(shader.CreateOutput("surface", types.Token))
        return look

    def _set_opacity(self, shader: Any, row: dict[str, Any], picture: Any, factor: Any) -> None:
        """Opacity, and where the colour's picture (None = none) cuts holes."""
        from pxr import Gf, Sdf

        types, is_mask = Sdf.ValueTypeNames, row["alphaMode"] == "MASK"
        if row["alphaMode"] == "OPAQUE":
            return
        threshold = float(row.get("alphaCutoff", USUAL_CUTOFF))
        has_holes = (is_mask and threshold <= 1) or "alphaCutoff" in row["extras"]
        opacity = shader.CreateInput("opacity", types.Float)
        if picture is not None and has_holes:
            # Of clear glass with holes the picture's alpha is multiplied by the glass's opacity.
            picture.GetInput("scale").Set(Gf.Vec4f(*factor[:3], 1.0 if is_mask else factor[3]))
            opacity.ConnectToSource(picture.CreateOutput("a", types.Float))
        else:
            opacity.Set(0.0 if is_mask else factor[3])
        if is_mask:
            least = threshold if has_holes else USUAL_CUTOFF
            shader.CreateInput("opacityThreshold", types.Float).Set(least)

    def _picture(self, path: str, number: int, space: str) -> Any:
        from pxr import Sdf, UsdShade

        parent = path.rsplit("/", 1)[0]
        reader = UsdShade.Shader.Define(self._stage, f"{parent}/St")
        reader.CreateIdAttr("UsdPrimvarReader_float2")
        reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
        st = reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
        node = UsdShade.Shader.Define(self._stage, path)
        node.CreateIdAttr("UsdUVTexture")
        file = Sdf.AssetPath(self._files[number])
        node.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(file)
        node.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(st)
        node.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set(space)
        for wrap in ("wrapS", "wrapT"):
            node.CreateInput(wrap, Sdf.ValueTypeNames.Token).Set("repeat")
        return node


def _quaternion(turn: Rotation) -> Any:
    from pxr import Gf

    x, y, z, w = (float(v) for v in turn.as_quat())
    return Gf.Quatf(w, x, y, z)


def _matrix(b_from_a: F64) -> Any:
    """A matrix of columns as USD's of rows."""
    from pxr import Gf

    return Gf.Matrix4d(*np.asarray(b_from_a, np.float64).T.ravel().tolist())


FORM = HomeForm(
    "usd",
    write_usd,
    "an OpenUSD stage (extra `usd`): `<id>/<id>.usdc` and `textures/`, metres, z up, gravity, for Isaac"
    " Sim and others",
    remark=COLLIDES,
    up="y",
)
