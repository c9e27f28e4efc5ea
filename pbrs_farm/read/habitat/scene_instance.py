"""A Habitat scene instance -> House, through one glTF scene. Reads files of its data set's folder."""

from __future__ import annotations

import csv
import io
import json
import posixpath
from collections.abc import Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Final

import numpy as np
from scipy.spatial.transform import Rotation

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.checked_json import json_from_bytes
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.frames import affine, transform_points
from pbrs_farm.core.house import House, Source
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.formats.glb import Gltf
from pbrs_farm.read.common.format import GivenFile
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.source_files import RootFolder, SourceFiles
from pbrs_farm.read.gltf.assembly import Assembly, files_of_asset
from pbrs_farm.read.gltf.document import meshes_of, numbers, object_at, placed_nodes
from pbrs_farm.read.gltf.scene import Beside, house_of_gltf
from pbrs_farm.read.robot.links import files_of_robot, model_name, placed_links, roots_of_robot
from pbrs_farm.read.robot.urdf import MAX_BYTES, Robot, Visual, robot_from_urdf
from pbrs_farm.regular_files import text_from_bytes

_CONFIG: Final = "*.scene_dataset_config.json"
_SECTIONS: Final = {
    "stage": "stages",
    "object": "objects",
    "ao": "articulated_objects",
    "lighting": "light_setups",
}  # kind of template -> its section of the data set's configuration
_LEVELS_UP: Final = 6  # from a scene to its data set's config
_ARTICULATED: Final = "articulated_object_instances"
_MOST_INSTANCES: Final = 20_000
_MOST_LIGHTS: Final = 1_000
_MOST_JSON_BYTES: Final = 64 * 2**20
_MOST_FILES: Final = 200_000
_BAKED: Final = "baked"


def read_habitat(given: GivenFile, fields: ReadFields) -> House:
    """Read a scene instance. Raises BadHouse, naming file and place.

    given.models: folder of the data set, if it is not above the file. Scenes with light baked into
    pictures are refused, and scenes with more than a third of their objects missing. Articulated
    objects have the instances' joint poses and the joints of their URDF.
    """
    path, models = given.path, given.models
    dataset = _Dataset(path, models)
    scene = dataset.json(dataset.scene)
    notes = Notes(path.name, strict=fields.strict)
    built = Assembly(path.name, dataset.folder, fields.max_model_triangles)
    stage = scene.get("stage_instance")
    template = stage.get("template_name") if isinstance(stage, dict) else None
    if not isinstance(template, str):
        raise BadHouse(path, "stage_instance.template_name", "expected a name")
    if _BAKED in template.lower():
        text = "its stage has light baked into its pictures, so it cannot be relit"
        raise BadHouse(path, f"stage_instance: {template}", text, hint="take the unbaked data set")
    _add_stage(dataset, template, built)
    rows = scene.get("object_instances", [])
    if not isinstance(rows, list) or len(rows) > _MOST_INSTANCES:
        text = f"expected a list of at most {_MOST_INSTANCES}"
        raise BadHouse(path, "object_instances", text)
    origin = scene.get("translation_origin", "COM")
    missing, errors = 0, list[BadHouse]()
    for k, row in enumerate(rows):
        place = f"object_instances[{k}]"
        try:
            missing += not _add_object(dataset, row, origin, place, built)
        except BadHouse as error:
            errors.append(error)
            notes.add("unreadable-model", place, f"{error.message[:200]}; it is left out")
    if missing:
        notes.add(
            "missing-model", "object_instances", f"{missing} of {len(rows)} have no model here"
        )
    _raise_if_many(errors, missing + len(errors), len(rows))
    if rows and missing > len(rows) / 3:
        text = f"{missing} of {len(rows)} objects have no model below {dataset.folder.root}"
        raise BadHouse(
            path, "object_instances", text, hint="get the data set's objects, or --models"
        )
    _add_lights(dataset, scene.get("default_lighting"), built, notes)
    _add_articulated(dataset, scene, built, notes)
    gltf = built.gltf()
    data = dataset.folder.read(dataset.scene, max_bytes=_MOST_JSON_BYTES) or b""
    source = Source("habitat", path.name, keys.sha256(data))
    stem = path.name.split(".")[0]
    rooms = _rooms_of_regions(dataset, scene.get("semantic_scene_instance"), stem)
    return house_of_gltf(gltf, source, stem, fields, notes, Beside(built.fetch, rooms=rooms))


def companions_of_habitat(given: GivenFile, files: SourceFiles) -> str:
    """Digest of the configs and models referenced by the scene; "" if there are none."""
    path, models = given.path, given.models
    try:
        dataset = _Dataset(path, models)
        scene = dataset.json(dataset.scene)
        names = set()
        instances = [scene.get(key) or [] for key in ("object_instances", _ARTICULATED)]
        rows = [scene.get("stage_instance"), *(row for some in instances for row in some)]
        templates = {r.get("template_name") for r in rows if isinstance(r, dict)}
        names |= set(dataset.configs)
        for template in sorted(t for t in templates if isinstance(t, str)):
            for kind in ("stage", "object"):
                settings, name = dataset.template(template, kind) or ({}, "")
                if name:
                    asset = settings.get("render_asset")
                    assets = [dataset.asset(name, asset)] if asset else []
                    names |= {name}.union(
                        *(files_of_asset(dataset.folder, m, files) for m in assets)
                    )
            urdf = dataset.urdf(template)
            if urdf is not None:
                names |= {urdf, *files_of_robot(dataset.robot(urdf), dataset.folder, urdf, files)}
                names |= {a[1] for a in [dataset.template(template, "ao")] if a}
        for pattern in ("*.semantic_config.json", "*objects.csv", "*.lighting_config.json"):
            names |= set(dataset.named(pattern))
    except (AttributeError, TypeError):
        return ""  # the reader reports the fault
    return files.digest(dataset.folder, names)


class _Dataset:
    """The files below the folder of a data set's config; state: a cache of parsed files."""

    def __init__(self, path: Path, models: str) -> None:
        above = [path.parent, *path.parents[1:_LEVELS_UP]]
        root = next((f for f in above if next(f.glob(_CONFIG), None)), None)
        if root is None:
            hint = "keep the scene in the folder of its data set"
            raise BadHouse(path, "", f"no {_CONFIG} in a folder above it", hint=hint)
        self.folder = RootFolder(root)
        self.configs = sorted(file.name for file in root.glob(_CONFIG))
        self.scene = path.relative_to(root).as_posix()
        self._parsed: dict[str, dict[str, Any]] = {}
        self._files = sorted(_names_below(root))
        self._known = frozenset(self._files)
        self._by_name: dict[str, str] = {}
        for name in self._files:
            self._by_name.setdefault(posixpath.basename(name), name)
        self._classes: dict[str, str] | None = None
        self._handles_of: dict[str, dict[str, None]] = {}  # kind -> names of templates

    def named(self, pattern: str) -> list[str]:
        """Files whose name fits a pattern."""
        return [n for n in self._files if fnmatchcase(posixpath.basename(n), pattern)]

    def json(self, name: str) -> dict[str, Any]:
        """The JSON object of a file; BadHouse for any other content."""
        if name not in self._parsed:
            data = self.folder.read(name, max_bytes=_MOST_JSON_BYTES)
            value = json_from_bytes(data or b"", name)
            if not isinstance(value, dict):
                raise BadHouse(name, "", "expected a JSON object")
            self._parsed[name] = value
        return self._parsed[name]

    def template(self, name: str, kind: str) -> tuple[dict[str, Any], str] | None:
        """Fields of a template, and the file that its paths are relative to; None if it is unknown.

        A template is an entry of `configs` in the data set's configuration, a config file, whose folders
        may be left out, or a model without a config. The data set's default attributes come first. As
        in Habitat, a part of a name is enough.
        """
        self.folder.name_from("", name)  # a name that leads out is refused
        base, defaults = _base_name(name, kind), dict[str, Any]()
        handles = self._handles(kind)
        if base and base not in handles and self._template_of_file(base, kind) is None:
            base = next((handle for handle in handles if base in handle), base)
        for config in self.configs:
            section = object_at(self.json(config), _SECTIONS[kind])
            defaults = defaults | object_at(section, "default_attributes")
            rows = section.get("configs", [])
            for row in rows if isinstance(rows, list) else []:
                original = row.get("original_file") if isinstance(row, dict) else None
                named = row.get("template_handle", original) if isinstance(row, dict) else None
                if not isinstance(named, str) or _base_name(named, kind) != base:
                    continue
                fields, file = self._template_of_file(str(original), kind) or ({}, config)
                return defaults | fields | object_at(row, "attributes"), file
        known = self._template_of_file(base, kind)
        return known and (defaults | known[0], known[1])

    def _handles(self, kind: str) -> dict[str, None]:
        """The names of all templates of a kind that have a config, in order."""
        if kind not in self._handles_of:
            names = [n.removesuffix(f".{kind}_config.json") for n in self._by_name]
            names = [
                _base_name(n, kind) for n, m in zip(names, self._by_name, strict=True) if n != m
            ]
            for config in self.configs:
                rows = object_at(self.json(config), _SECTIONS[kind]).get("configs", [])
                for row in rows if isinstance(rows, list) else []:
                    named = row.get("template_handle") if isinstance(row, dict) else None
                    names += [_base_name(named, kind)] if isinstance(named, str) else []
            self._handles_of[kind] = dict.fromkeys(sorted(names))
        return self._handles_of[kind]

    def _template_of_file(self, name: str, kind: str) -> tuple[dict[str, Any], str] | None:
        base = _base_name(name, kind)
        config = self._by_name.get(f"{base}.{kind}_config.json")
        if config is not None:
            return self.json(config), config
        model = self._by_name.get(f"{base}.glb") if kind in ("stage", "object") else None
        return ({"render_asset": posixpath.basename(model)}, model) if model else None

    def asset(self, config: str, reference: Any) -> str:
        """The name below the root of an asset that a config names."""
        if not isinstance(reference, str):
            raise BadHouse(config, "render_asset", "expected a name")
        return self.folder.name_from(posixpath.dirname(config), reference)

    def urdf(self, template: str) -> str | None:
        """Name of the URDF of an articulated object's template, if any."""
        settings, config = self.template(template, "ao") or ({}, "")
        named = settings.get("urdf_filepath")
        if isinstance(named, str):
            name = self.folder.name_from(posixpath.dirname(config), named)
            return name if name in self._known else None
        base = posixpath.basename(template).removesuffix(".urdf")
        return self._by_name.get(f"{base}.urdf")

    def robot(self, name: str) -> Robot:
        """The links and joints of a URDF; BadHouse where it is damaged."""
        return robot_from_urdf(self.folder.read(name, max_bytes=MAX_BYTES) or b"", name)

    def class_of(self, template: str) -> str:
        """Category of a model in objects.csv, "" if it has none."""
        if self._classes is None:
            self._classes = {}
            for name in self.named("*objects.csv"):
                data = self.folder.read(name, max_bytes=_MOST_JSON_BYTES) or b""
                for row in csv.DictReader(io.StringIO(text_from_bytes(data, "replace"))):
                    words = [row.get(k) for k in ("main_category", "category", "name")]
                    category = next((w for w in words if w), "")
                    self._classes[next(iter(row.values())) or ""] = str(category)
        return self._classes.get(posixpath.basename(template), "")


def _base_name(name: str, kind: str) -> str:
    """Name of a template without folders and the ending of its file."""
    base = posixpath.basename(name).removesuffix(f".{kind}_config.json")
    return base.removesuffix(".glb") if kind in ("stage", "object") else base


def _names_below(root: Path) -> list[str]:
    names = []
    for path in root.rglob("*"):
        names.append(path.relative_to(root).as_posix())
        if len(names) > _MOST_FILES:
            raise BadHouse(root, "", f"holds more than {_MOST_FILES} files")
    return names


def _add_stage(dataset: _Dataset, template: str, built: Assembly) -> None:
    known = dataset.template(template, "stage")
    if known is None:
        raise BadHouse(dataset.scene, f"stage_instance: {template}", "has no stage_config.json")
    row, config = known
    name = dataset.asset(config, row.get("render_asset"))
    if _BAKED in name.lower():
        text = "has light baked into its pictures, so it cannot be relit"
        raise BadHouse(config, "render_asset", text, hint="take the unbaked data set")
    added = built.asset(name)
    if added is None:
        raise BadHouse(config, "render_asset", f"{name} does not exist")
    matrix = _upright_matrix(row, added[1], config)
    # Keep the stage's roots separate, so that their names and extras give their classes.
    for root in added[0]:
        built.place([root], matrix, "", {})


def _raise_if_many(errors: Sequence[BadHouse], n_lost: int, n_rows: int) -> None:
    """Raise the first error of damaged objects if more than a third of all objects are lost."""
    if errors and n_lost > n_rows / 3:
        raise errors[0]


def _add_object(dataset: _Dataset, row: Any, origin: Any, place: str, built: Assembly) -> bool:
    """Whether an object instance has a model here; it is placed."""
    if not isinstance(row, dict) or not isinstance(row.get("template_name"), str):
        raise BadHouse(dataset.scene, f"{place}.template_name", "expected a name")
    template = row["template_name"]
    settings, config = dataset.template(template, "object") or ({}, "")
    added = None
    if settings.get("render_asset"):
        added = built.asset(dataset.asset(config, settings["render_asset"]))
    if added is None:
        return False
    roots, gltf = added
    matrix = _matrix_of_instance(row, place, dataset.scene)
    inner = _upright_matrix(settings, gltf, config)
    if str(row.get("translation_origin", origin)).lower() != "asset_local":
        centre = _centre(gltf, inner, settings, config)
        inner = inner.copy()
        inner[:3, 3] -= centre
    name = dataset.class_of(template) or str(settings.get("name") or posixpath.basename(template))
    user_fields = row.get("user_defined")
    own_fields = dict(user_fields) if isinstance(user_fields, dict) else {}
    built.place(roots, matrix @ inner, name, {"one": True} | own_fields)
    return True


def _matrix_of_instance(row: dict[str, Any], place: str, file: str) -> F64:
    """(4, 4) what an instance's translation, rotation and scales say."""
    where = Gltf({}, (), file)
    moved = numbers(where, row.get("translation", [0, 0, 0]), 3, f"{place}.translation")
    w, x, y, z = numbers(where, row.get("rotation", [1, 0, 0, 0]), 4, f"{place}.rotation")
    if not 0.5 < float(np.linalg.norm([w, x, y, z])) < 2:
        raise BadHouse(file, f"{place}.rotation", "is not a unit quaternion")
    (size,) = numbers(where, [row.get("uniform_scale", 1.0)], 1, f"{place}.uniform_scale")
    sizes = numbers(where, row.get("non_uniform_scale", [1, 1, 1]), 3, f"{place}.non_uniform_scale")
    return affine(Rotation.from_quat([x, y, z, w]).as_matrix() * (size * sizes), moved)


def _add_articulated(
    dataset: _Dataset, scene: dict[str, Any], built: Assembly, notes: Notes
) -> None:
    """Place the articulated objects; a note counts those whose URDF or models are not here."""
    rows = scene.get(_ARTICULATED) or []
    if not isinstance(rows, list) or len(rows) > _MOST_INSTANCES:
        text = f"expected a list of at most {_MOST_INSTANCES}"
        raise BadHouse(dataset.scene, _ARTICULATED, text)
    n_missing, n_unread, errors = 0, 0, list[BadHouse]()
    for k, row in enumerate(rows):
        place = f"{_ARTICULATED}[{k}]"
        if not isinstance(row, dict) or not isinstance(row.get("template_name"), str):
            raise BadHouse(dataset.scene, f"{place}.template_name", "expected a name")
        try:
            urdf = dataset.urdf(row["template_name"])
            robot = None if urdf is None else dataset.robot(urdf)
            n_unread += 0 if robot is None else robot.n_unread
            is_added = robot and _add_robot(dataset, str(urdf), robot, row, place, built)
            n_missing += not is_added
        except BadHouse as error:
            errors.append(error)
            notes.add("unreadable-model", place, f"{error.message[:200]}; it is left out")
    _raise_if_many(errors, len(errors), len(rows))
    if n_missing:
        notes.add("missing-model", _ARTICULATED, f"{n_missing} of {len(rows)} have no model here")
    if n_unread:
        text = f"{n_unread} shapes of URDF other than meshes, boxes, cylinders and spheres"
        notes.add("unread-part", _ARTICULATED, text)


def _add_robot(
    dataset: _Dataset, urdf: str, robot: Robot, row: dict[str, Any], place: str, built: Assembly
) -> bool:
    """Place the links of a robot as an instance says; whether any of its models is here."""
    template = row["template_name"]
    settings, config = dataset.template(template, "ao") or ({}, "")
    pose = row.get("initial_joint_pose")
    order = str(row.get("link_order", settings.get("link_order", "")))
    values = robot.values(pose, dataset.scene, f"{place}.initial_joint_pose", order)
    (size,) = numbers(
        Gltf({}, (), config or dataset.scene),
        [settings.get("uniform_scale", 1.0)],
        1,
        "uniform_scale",
    )
    inner = np.diag([size, size, size, 1.0])
    world_from_robot = _matrix_of_instance(row, place, dataset.scene) @ inner
    # habitat-sim scales offsets, shapes and limits, but not the pose of a slide.
    scale = float(np.cbrt(abs(np.linalg.det(world_from_robot[:3, :3])))) or 1.0
    parent = posixpath.dirname(urdf)

    def roots_of(visual: Visual) -> list[int] | None:
        added = built.asset(model_name(visual.file, dataset.folder, parent), visual.rgba)
        return added and added[0]

    node_of = placed_links(built, robot, roots_of, values, scale)
    if not node_of:
        return False
    roots = roots_of_robot(robot, node_of)
    name = dataset.class_of(template) or posixpath.basename(template).removesuffix(".urdf")
    user_fields = row.get("user_defined")
    own_fields = dict(user_fields) if isinstance(user_fields, dict) else {}
    built.place(roots, world_from_robot, name, {"one": True, "by_name": True} | own_fields)
    return True


def _add_lights(dataset: _Dataset, named: Any, built: Assembly, notes: Notes) -> None:
    """Place point lights, each as strong as a bulb, as Habitat's have no unit; a note counts other kinds."""
    known = dataset.template(named, "lighting") if isinstance(named, str) and named else None
    if known is None:
        return
    settings, config = known
    rows = settings.get("lights", {})
    if not isinstance(rows, dict) or len(rows) > _MOST_LIGHTS:
        raise BadHouse(config, "lights", f"expected an object of at most {_MOST_LIGHTS}")
    where = Gltf({}, (), config)
    n_left_out = 0
    for key, row in rows.items():
        place = f"lights[{key[:20]}]"
        if not isinstance(row, dict):
            raise BadHouse(config, place, "expected an object")
        (strength,) = numbers(where, [row.get("intensity", 1.0)], 1, f"{place}.intensity")
        is_fixed = row.get("position_model", "global") == "global"
        if row.get("type", "point") != "point" or strength <= 0 or not is_fixed:
            n_left_out += 1
            continue
        position = numbers(where, row.get("position", [0, 0, 0]), 3, f"{place}.position")
        colour = numbers(where, row.get("color", [1, 1, 1]), 3, f"{place}.color").tolist()
        bulb = {"type": "point", "color": colour, "extras": {"assumed": True}}
        built.roots.append(built.light_node(bulb, position, f"lamp {key[:20]}"))
    if n_left_out:
        text = f"{n_left_out} are directional, dark or not of the room; left out"
        notes.add("unread-part", f"{config}: lights", text)


def _centre(gltf: Gltf, inner: F64, settings: dict[str, Any], config: str) -> F64:
    """Origin of the instance's translation: the given centre of mass, else the box's centre."""
    if "COM" in settings:
        return numbers(Gltf({}, (), config), settings["COM"], 3, "COM")
    points = []
    for node in placed_nodes(gltf):
        mesh = gltf.document["nodes"][node.index].get("mesh")
        if mesh is not None:
            for _number, primitive in meshes_of(gltf, mesh, max_triangles=2_000_000):
                points.append(transform_points(inner @ node.world_from_node, primitive.positions))
    if not points:
        return np.zeros(3)
    positions = np.concatenate(points)
    return np.asarray((positions.min(0) + positions.max(0)) / 2)


def _upright_matrix(row: dict[str, Any], gltf: Gltf, config: str) -> F64:
    """(4, 4) that turns an asset's up and front to +y and -z and scales it."""
    where = Gltf({}, (), config)
    up = numbers(where, row.get("up", [0, 1, 0]), 3, "up")
    front = numbers(where, row.get("front", [0, 0, -1]), 3, "front")
    lengths = np.linalg.norm(up), np.linalg.norm(front)
    if min(lengths) < 1e-6 or abs(up @ front) > 0.01 * lengths[0] * lengths[1]:
        raise BadHouse(config, "up, front", "are not at right angles")
    up, back = up / lengths[0], -front / lengths[1]
    scale = numbers(where, row.get("scale", [1, 1, 1]), 3, "scale")
    (unit,) = numbers(where, [row.get("units_to_meters", 1.0)], 1, "units_to_meters")
    return affine(np.stack([np.cross(up, back), up, back]) * (scale * unit))


def _rooms_of_regions(dataset: _Dataset, named: Any, stem: str) -> bytes | None:
    """The regions of the scene's semantic config as a room file; None without regions."""
    base = posixpath.basename(named) if isinstance(named, str) else stem
    base = base.removesuffix(".semantic_config.json")
    config = next((n for n in dataset.named(f"{base}.semantic_config.json")), None)
    if config is None:
        return None
    rows = dataset.json(config).get("region_annotations")
    rooms = []
    for k, row in enumerate(rows if isinstance(rows, list) else []):
        place = f"region_annotations[{k}]"
        loop = row.get("poly_loop") if isinstance(row, dict) else None
        if not isinstance(loop, list) or len(loop) < 3:
            raise BadHouse(config, place, "has no poly_loop of three corners or more")
        where = Gltf({}, (), config)
        corners = [numbers(where, corner, 3, f"{place}.poly_loop") for corner in loop]
        floor = row.get("floor_height", float(min(c[1] for c in corners)))
        high = row.get("extrusion_height")
        (floor_y,) = numbers(where, [floor], 1, f"{place}.floor_height")
        label = str(row.get("label") or row.get("name") or "")[:60]
        room: dict[str, Any] = {
            "name": str(row.get("name") or label)[:60],
            "types": [label] if label else [],
            "polygon": [[float(c[0]), float(c[2])] for c in corners],
            "floor_y": float(floor_y),
        }
        if type(high) in (int, float) and 0.5 < high < 50:
            room["ceiling_y"] = float(floor_y + high)
        rooms.append(room)
    return json.dumps({"rooms": rooms}).encode() if rooms else None
