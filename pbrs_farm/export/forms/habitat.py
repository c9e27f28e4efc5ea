"""A home as a Habitat data set of one scene: stage, objects, regions. Effects: writes files.

The building is the stage; each item is an object with its own collision parts, or an articulated
object if it opens. `pbrs-farm run` reads the scene back.
"""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree as ET

import numpy as np
from scipy.spatial.transform import Rotation

from pbrs_farm.core.arrays import F64
from pbrs_farm.export.content import write_files
from pbrs_farm.export.form import HomeForm
from pbrs_farm.export.home_files import digest_name, xml_bytes
from pbrs_farm.export.home_glb import glb_of_pieces
from pbrs_farm.export.home_pieces import COLLIDES, COLLISION, ExportedHome, Piece
from pbrs_farm.export.urdf_links import add_inertial, add_mesh, add_moving_joint
from pbrs_farm.formats.glb import GlbWriter
from pbrs_farm.formats.house_glb import item_extras
from pbrs_farm.geometry.convex_parts import hull_faces

_BODY: Final = "body"


def write_habitat(home: ExportedHome, folder: Path) -> None:
    """Write the data set below folder."""
    house, files = home.house, {}
    opening = [piece for piece in home.pieces if piece.opens]
    still = [piece for piece in home.building if not piece.opens]
    files[f"stages/{house.id}.glb"] = glb_of_pieces(house, still, with_lamps=False)
    files[f"stages/{house.id}.stage_config.json"] = _json({"render_asset": f"{house.id}.glb"})
    instances = []
    for piece in home.things:
        if piece.opens:
            continue
        data = glb_of_pieces(house, [piece], with_lamps=True, in_place=False)
        name = f"{piece.class_name.replace(' ', '_')}_{digest_name(data)}"
        if f"objects/{name}.glb" not in files:
            files[f"objects/{name}.glb"] = data
            config: dict[str, Any] = {"render_asset": f"{name}.glb", "mass": piece.mass_kg}
            if piece.colliders:
                files[f"objects/{name}.collision.glb"] = _collision(piece.colliders)
                config |= {
                    "collision_asset": f"{name}.collision.glb",
                    "join_collision_meshes": False,
                }
            files[f"objects/{name}.object_config.json"] = _json(
                config | {"semantic_id": piece.item.nyu40}
            )
        instances.append(_instance(home, piece, name))
    articulated = []
    for piece in opening:
        name, piece_files = _articulated(home, piece)
        files |= {f"urdf/{name}/{file}": data for file, data in piece_files.items()}
        pose = [body.joint.value for body in piece.bodies if body.joint is not None]
        base = {"fixed_base": piece.is_fixed, "base_type": "fixed" if piece.is_fixed else "free"}
        row = _instance(home, piece, name) | base | {"initial_joint_pose": pose}
        articulated.append(row)
    files[f"scenes/{house.id}.scene_instance.json"] = _json(
        {
            "stage_instance": {"template_name": f"stages/{house.id}"},
            "object_instances": instances,
            "articulated_object_instances": articulated,
            "semantic_scene_instance": house.id,
            "translation_origin": "asset_local",
            "user_defined": {"collision": COLLISION},
        }
    )
    files[f"semantics/{house.id}.semantic_config.json"] = _json(
        {"region_annotations": _regions(home)}
    )
    files[f"navigable/{house.id}.json"] = _json(
        {room: [ring.tolist() for ring in rings] for room, rings in home.navigable.items()}
    )
    files[f"{house.id}.scene_dataset_config.json"] = _json(
        {
            "stages": {"paths": {".json": ["stages"]}},
            "objects": {"paths": {".json": ["objects"]}},
            "articulated_objects": {"paths": {".urdf": ["urdf/*"]}},
            "scene_instances": {"paths": {".json": ["scenes"]}},
            "semantic_scene_descriptor_instances": {"paths": {".json": ["semantics"]}},
        }
    )
    write_files(folder, [files])


def _json(value: Any) -> bytes:
    return json.dumps(value, indent=1, allow_nan=False).encode()


def _instance(home: ExportedHome, piece: Piece, name: str) -> dict[str, Any]:
    x, y, z, w = Rotation.from_matrix(piece.world_from_local[:3, :3]).as_quat().tolist()
    number = next(k for k, p in enumerate(home.pieces) if p is piece) + 1
    return {
        "template_name": name,
        "translation": piece.world_from_local[:3, 3].tolist(),
        "rotation": [w, x, y, z],
        "translation_origin": "asset_local",
        "motion_type": "STATIC" if piece.is_fixed else "DYNAMIC",
        "user_defined": item_extras(piece.item, number),
    }


def _articulated(home: ExportedHome, piece: Piece) -> tuple[str, dict[str, bytes]]:
    """The name of a piece that opens, and its files: URDF, config, a GLB a link and a convex part.

    Axes are the piece's, y up, as of all Habitat's models.
    """
    root = ET.Element("robot", name=piece.class_name.replace(" ", "_"))
    files: dict[str, bytes] = {}

    def file_of(data: bytes, name: str) -> str:
        file = f"{name}_{digest_name(data)}.glb"
        files[file] = data
        return file

    for body in piece.bodies:
        name = re.sub(r"[^A-Za-z0-9]+", "_", body.part) or _BODY
        element = ET.SubElement(root, "link", name=name)
        frame = np.eye(4)
        if body.joint is not None:
            frame = add_moving_joint(root, name, _BODY, body.joint, np.eye(3))
        shape = body.shape(frame)
        add_inertial(element, body.mass_kg, shape, np.eye(3))
        # Lamps and the frame of the piece stay with its body.
        visual = replace(piece, surfaces=shape.surfaces, lamps=() if body.joint else piece.lamps)
        data = glb_of_pieces(home.house, [visual], with_lamps=True, in_place=False)
        add_mesh(element, "visual", file_of(data, name))
        for part in shape.colliders:
            add_mesh(element, "collision", file_of(_collision((part,)), "part"))
    text = xml_bytes(root)
    named = f"{root.get('name')}_{digest_name(text)}"
    config = {"urdf_filepath": f"{named}.urdf", "semantic_id": piece.item.nyu40}
    return named, files | {f"{named}.urdf": text, f"{named}.ao_config.json": _json(config)}


def _regions(home: ExportedHome) -> list[dict[str, Any]]:
    return [
        {
            "name": room.name,
            "label": room.types[0] if room.types else room.name,
            "floor_height": float(room.floor_y),
            "extrusion_height": float(room.ceiling_y - room.floor_y),
            "poly_loop": [[float(x), float(room.floor_y), float(z)] for x, z in room.polygon],
        }
        for room in home.house.rooms
    ]


def _collision(parts: tuple[F64, ...]) -> bytes:
    """A GLB with a mesh for each convex part."""
    writer, meshes = GlbWriter(), []
    for part in parts:
        faces = hull_faces(part).astype(np.int32)
        row = {
            "attributes": {
                "POSITION": writer.add_vertices(part.astype(np.float32), with_bounds=True)
            }
        }
        meshes.append({"primitives": [row | {"indices": writer.add_faces(faces)}]})
    nodes = [{"mesh": k, "name": f"part {k}"} for k in range(len(parts))]
    scene = {"nodes": list(range(len(nodes)))}
    return writer.glb(
        {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [scene],
            "nodes": nodes,
            "meshes": meshes,
        }
    )


FORM = HomeForm(
    "habitat",
    write_habitat,
    "a Habitat data set: the building as stage, an object with collision parts for each item, an"
    " articulated object for each item with joints, regions, and `navigable/<id>.json`, the outlines of the floor"
    " area free for a disc of 0.2 m",
    remark=COLLIDES,
    up="y",
)
