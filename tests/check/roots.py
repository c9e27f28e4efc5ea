"""A finished output root with labels of the small home, like that of a run (no light, no GL)."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

from pbrs_farm import truth
from pbrs_farm.check import verify
from pbrs_farm.core import keys
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.house import House, geometry_from_house
from pbrs_farm.core.layers import LAYER, OPTIONAL, OWN_LAYERS
from pbrs_farm.formats.house_bundle import bundle_from_house
from pbrs_farm.formats.layer_file import layer_bytes
from pbrs_farm.formats.manifest import manifest_from_markers
from pbrs_farm.formats.marker import Marker, StoredFile
from pbrs_farm.home.masses import weighed
from pbrs_farm.images import exr_from_layers, png_from_array
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.read.builtin.builtin_home import builtin_home
from pbrs_farm.run.house_cache import decoded_textures

SIZE = (128, 96)


def views_of(home: House) -> dict[str, Camera]:
    """The home's stored cameras at a small size."""
    intrinsics = Intrinsics.from_hfov(*SIZE)
    return {f"v{k}": Camera.look(intrinsics, c.eye, c.towards) for k, c in enumerate(home.cameras)}


def all_layers() -> tuple[str, ...]:
    """Every optional layer of the package."""
    return tuple(x.name for x in OWN_LAYERS if x.name in OPTIONAL)


def encoded(name: str, array: np.ndarray) -> bytes:
    """The bytes of a layer's file."""
    if LAYER[name].file.endswith(".png"):
        return layer_bytes(name, array)
    names = LAYER[name].channels.split()
    planes = [array] if len(names) == 1 else list(np.moveaxis(array, -1, 0))
    return exr_from_layers({n: np.ascontiguousarray(p) for n, p in zip(names, planes, strict=True)})


def make_root(
    root: Path,
    home: House | None = None,
    cameras: dict[str, Camera] | None = None,
    *,
    with_optional: bool = False,
    caster: Caster | None = None,
) -> Path:
    """Write the root and return its house folder; by default of the small home."""
    home = weighed(home or builtin_home())
    house = root / "houses" / home.id
    geometry = geometry_from_house(home)
    caster = caster or Caster.of_house(home, geometry)
    glb, plain = bundle_from_house(home)
    files = {"house": {"house.glb": glb, "house.json": plain}}
    for name, camera in (cameras or views_of(home)).items():
        hit = caster.hit_record(camera)
        layers = truth.layers_from_hit(hit, home, camera)
        table = {
            "house": home.id,
            "view": name,
            **truth.view_table(hit.item, home, camera, cut_outs=caster.cut_outs),
        }
        label_inputs = truth.LabelInputs(
            hit,
            home,
            geometry,
            camera,
            lambda skip, c=camera: caster.hit_record(c, skip_faces=skip),
            decoded_textures(home)[0],
            first_hit=caster.first_hit,
        )
        names = truth.OPTIONAL_NAMES if with_optional else ()
        layers |= truth.optional_layers(names, label_inputs)
        table |= truth.optional_tables(names, home)
        of_view = {LAYER[k].file: encoded(k, v) for k, v in layers.items()}
        of_view["view.json"] = json.dumps(table).encode()
        if with_optional:
            rows = truth.articulation_table(layers["part"], home, camera)
            of_view[keys.ARTICULATION] = json.dumps(rows).encode()
        files[f"truth.{name}"] = {f"views/{name}/{k}": v for k, v in of_view.items()}
    for step, contents in files.items():
        for file, data in contents.items():
            (house / file).parent.mkdir(parents=True, exist_ok=True)
            (house / file).write_bytes(data)
        (house / "done").mkdir(exist_ok=True)
        (house / "done" / f"{step}.json").write_text(json.dumps({"files": list(contents)}))
    sign(root, house)
    return house


def sign(root: Path, house: Path) -> None:
    """Make manifest, markers and house.json agree with the present files."""
    markers = []
    description = house / "house.json"
    if description.is_file() and (house / "house.glb").is_file():
        house_json = json.loads(description.read_text())
        digest = keys.sha256((house / "house.glb").read_bytes())
        if house_json.get("glb_sha256") != digest:
            description.write_text(json.dumps(house_json | {"glb_sha256": digest}))
    for marker in sorted((house / "done").glob("*.json")):
        stood = json.loads(marker.read_text())
        old = stood["files"]
        names = [f if isinstance(f, str) else f["key"].split("/", 2)[2] for f in old]
        stored = []
        for name in names:
            data = (house / name).read_bytes()
            key = keys.house_key(house.name, name)
            stored.append(StoredFile(key=key, n_bytes=len(data), sha256=keys.sha256(data)))
        step, _, view = marker.stem.partition(".")
        whole = Marker(
            step=step, house_id=house.name, view_id=view or None, digest=stood.get("digest", "0"),
            files=tuple(stored), facts=stood.get("facts", {}),
        )  # fmt: skip
        marker.write_text(whole.model_dump_json())
        markers.append(whole)
    lines = manifest_from_markers(markers, "")
    (house / "manifest.jsonl").write_bytes(lines)
    (root / "manifest.jsonl").write_bytes(lines)


def changed_pixel(file: Path, row: int, column: int, by: int) -> None:
    """Add by to one pixel of a PNG (its first channel)."""
    from pbrs_farm.images import array_from_png

    array = array_from_png(file.read_bytes()).copy()
    index = (row, column) if array.ndim == 2 else (row, column, 0)
    array[index] = np.array(int(array[index]) + by).astype(array.dtype)
    file.write_bytes(png_from_array(array))


def house_of(root: Path) -> Path:
    """The root's first house."""
    return next((root / "houses").iterdir())


def failed(root: Path, *, all_pixels: bool = True) -> set[str]:
    """Names of the checks that fail."""
    certificate = verify(root, all_pixels=all_pixels)
    return {name for name, count in certificate.counts.items() if count.failed}


def edit_table(root: Path, change: Callable[[dict], object]) -> None:
    """Change the table of view v0 and make manifest and markers agree with it."""
    file = house_of(root) / "views/v0/view.json"
    table = json.loads(file.read_text())
    change(table)
    file.write_text(json.dumps(table))
    sign(root, house_of(root))
