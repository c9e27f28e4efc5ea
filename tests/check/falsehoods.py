"""Kinds of falsehood, each planted in a finished root: the change, and the check that must find it.

Effects: a plant changes files of the given root; `planted` updates all hashes afterwards.
"""

from __future__ import annotations

import json
import shutil
import struct
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from pbrs_farm.check import verify
from pbrs_farm.core.recipe import recipe_from_json
from pbrs_farm.formats.pairs_parquet import pairs_from_parquet, pairs_parquet
from pbrs_farm.images import array_from_png, exr_from_layers, layers_from_exr, png_from_array
from pbrs_farm.run.house_cache import HouseCache
from pbrs_farm.run.light_again import LightAgain
from pbrs_farm.run.step_cache import Work
from pbrs_farm.run.steps import run_step
from pbrs_farm.store.folder import FolderStore
from tests.check.roots import house_of, sign
from tests.check.sorts_of_roots import sunlit

Plant = Callable[[Path], None]


def view_of(root: Path) -> Path:
    """The first view of a root."""
    return min((house_of(root) / "views").iterdir())


def edit_json(file: Path, change: Callable[[dict], object]) -> None:
    """Change a JSON file in place."""
    document = json.loads(file.read_text())
    change(document)
    file.write_text(json.dumps(document))


def json_file(name: str, change: Callable[[dict], object]) -> Plant:
    """Change a JSON file of the view."""
    return lambda view: edit_json(view / name, change)


def table(change: Callable[[dict], object]) -> Plant:
    """Change view.json."""
    return json_file("view.json", change)


def row(change: Callable[[dict], object]) -> Plant:
    """Change the row of the largest instance."""
    return table(lambda t: change(max(t["instances"], key=lambda r: r["pixels"])))


def picture(file: str, change: Callable[[np.ndarray], np.ndarray]) -> Plant:
    def plant(view: Path) -> None:
        array = array_from_png((view / file).read_bytes())
        new = np.ascontiguousarray(change(array.astype(float)))
        most = np.iinfo(array.dtype).max
        (view / file).write_bytes(png_from_array(np.rint(new).clip(0, most).astype(array.dtype)))

    return plant


def patch(by: float) -> Callable[[np.ndarray], np.ndarray]:
    def change(array: np.ndarray) -> np.ndarray:
        out = array.copy()
        out[50:70, 60:90] = np.where(out[50:70, 60:90] > by, out[50:70, 60:90] - by, by)
        return out

    return change


def scaled(by: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda array: array * by


def mirrored(array: np.ndarray) -> np.ndarray:
    return array[:, ::-1]


def exr(file: str, change: Callable[[np.ndarray], np.ndarray]) -> Plant:
    def plant(view: Path) -> None:
        planes = layers_from_exr((view / file).read_bytes())
        changed = {n: np.ascontiguousarray(change(p), np.float32) for n, p in planes.items()}
        (view / file).write_bytes(exr_from_layers(changed))

    return plant


def moved_surface(array: np.ndarray) -> np.ndarray:
    """A patch of surfaces 3 mm farther, where there are any."""
    out = array.copy()
    out[40:80, 50:100] += 3 * (out[40:80, 50:100] > 0)
    return out


def other_surface(array: np.ndarray) -> np.ndarray:
    """A patch of surfaces with the next id, where there are any."""
    return np.sign(array) * (array + (np.arange(array.shape[1]) < 60))


def exchanged_holes(array: np.ndarray) -> np.ndarray:
    """Mirrors for clear surfaces, and slants for shadows and dark surfaces."""
    reason = np.array([0, 2, 1, 6, 5, 4, 8, 8, 7])
    return reason[array.astype(int)]


def brighter_shading(view: Path) -> None:
    """Shading a tenth brighter, with a residual that compensates."""
    srgb = array_from_png((view / "albedo.png").read_bytes()) / 255
    albedo = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    for ending in ("", "_indoor", "_outdoor"):
        files = view / f"shading{ending}.exr", view / f"residual{ending}.exr"
        lit, residual = (layers_from_exr(file.read_bytes()) for file in files)
        for k, c in enumerate("RGB"):
            residual[c] = (residual[c] - 0.1 * albedo[..., k] * lit[c]).astype(np.float32)
            lit[c] = (1.1 * lit[c]).astype(np.float32)
        for file, planes in zip(files, (lit, residual), strict=True):
            file.write_bytes(exr_from_layers(planes))


def brighter_diffuse_light(view: Path) -> None:
    """The same, with the diffuse light that it is computed from."""
    brighter_shading(view)
    planes = layers_from_exr((view / "radiance.exr").read_bytes())
    for name in planes:
        if name.startswith(("diffuse_outdoor", "diffuse_indoor")):
            planes[name] = (1.1 * planes[name]).astype(np.float32)
    (view / "radiance.exr").write_bytes(exr_from_layers(planes))


def histogram(change: Callable[[dict], object]) -> Plant:
    """Change histogram.json."""
    return json_file("histogram.json", change)


def move_count(counts: dict) -> None:
    numbers = list(counts["counts"])
    numbers[0], numbers[-1] = numbers[0] + 40, numbers[-1] - 40
    counts["counts"] = numbers


def turn_box(r: dict) -> None:
    # Another frame, enlarged until it encloses the old box.
    c, s = np.cos(0.3), np.sin(0.3)
    r["box3d"]["axes"] = (
        np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ r["box3d"]["axes"]
    ).tolist()


def move_box(r: dict) -> None:
    r["box3d"]["centre"][0] += 0.05


def other_share(r: dict) -> None:
    f = r["visible_fraction"]
    r["visible_fraction"] = f * 0.7


def pose(change: Callable[[np.ndarray], None]) -> Plant:
    def both(t: dict) -> None:
        for name in ("world_from_camera_opengl", "world_from_camera_opencv"):
            matrix = np.array(t[name])
            change(matrix)
            t[name] = matrix.tolist()

    return table(both)


def step_aside(matrix: np.ndarray) -> None:
    matrix[0, 3] += 0.02


def brighter_with_its_facts(view: Path) -> None:
    picture("mlt_ol.png", scaled(1.1))(view)
    table(lambda t: t["modes"]["develop"]["mlt_ol"].update(exposure=9.0))(view)


def swapped_ids(view: Path) -> None:
    file = view / "instance.png"
    ids = array_from_png(file.read_bytes()).copy()
    a, b = np.argsort(np.bincount(ids.reshape(-1)))[::-1][:2]
    ids[:60][ids[:60] == a] = b
    file.write_bytes(png_from_array(ids))


def document(name: str, change: Callable[[dict], object]) -> Plant:
    """Change a JSON file of the view's house, or of the root for its recipe."""

    level = 3 if name == "recipe.json" else 1
    return lambda view: edit_json(view.parents[level] / name, change)


def glb(change: Callable[[dict], object]) -> Plant:
    """Change the JSON of house.glb."""

    def plant(view: Path) -> None:
        file = view.parents[1] / "house.glb"
        data = file.read_bytes()
        (n,) = struct.unpack_from("<I", data, 12)
        document = json.loads(data[20 : 20 + n])
        change(document)
        text = json.dumps(document).encode()
        text += b" " * (-len(text) % 4)
        rest = data[20 + n :]
        head = struct.pack("<4sIII4s", b"glTF", 2, 20 + len(text) + len(rest), len(text), b"JSON")
        file.write_bytes(head + text + rest)

    return plant


def text_file(name: str, change: Callable[[str], str]) -> Plant:
    def plant(view: Path) -> None:
        file = view.parents[1] / name
        file.write_text(change(file.read_text()))

    return plant


def both(*plants: Plant) -> Plant:
    def plant(view: Path) -> None:
        for change in plants:
            change(view)

    return plant


def placed(change: Callable[[dict], object]) -> Plant:
    """Change the row of the first placed model."""
    return table(lambda t: change(next(r for r in t["instances"] if "model" in r)))


def moved(name: str, by: float) -> Callable[[dict], object]:
    return lambda row: row[name][0].__setitem__(3, row[name][0][3] + by)


def swapped(a: str, b: str) -> Plant:
    """Exchange two files of a view."""

    def plant(view: Path) -> None:
        first, second = (view / a).read_bytes(), (view / b).read_bytes()
        (view / a).write_bytes(second)
        (view / b).write_bytes(first)

    return plant


def of_neighbour(*files: str) -> Plant:
    """Copy files from another view of the home."""

    def plant(view: Path) -> None:
        neighbour = next(v for v in sorted(view.parent.iterdir()) if v != view)
        for file in files:
            shutil.copy(neighbour / file, view / file)

    return plant


def scene_without_outside(gltf: dict) -> None:
    scene = gltf["scenes"][0]
    scene["nodes"] = [
        n for n in scene["nodes"] if not gltf["nodes"][n]["extras"]["item"].startswith("outside")
    ][: len(scene["nodes"]) - 1]


def without_credit(gltf: dict) -> None:
    gltf["asset"].pop("copyright", None)


def pairs(change: Callable[[list[dict]], object]) -> Plant:
    """Change the rows of pairs.parquet."""

    def plant(view: Path) -> None:
        file = view.parents[1] / "pairs.parquet"
        rows = pairs_from_parquet(file.read_bytes(), str(file))
        change(rows)
        file.write_bytes(pairs_parquet(rows))

    return plant


def turned_by(degrees: float) -> Callable[[np.ndarray], np.ndarray]:
    """Stored normals turned about the camera's up."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))

    def change(stored: np.ndarray) -> np.ndarray:
        n = stored * (2 / 65535) - 1
        turned = n @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        return (turned + 1) * 65535 / 2

    return change


def lamps(change: Callable[[dict, dict], object]) -> Plant:
    """Change the rows of the two brightest lamps."""

    def both_rows(t: dict) -> None:
        rows = sorted(t["modes"]["light"]["lamps"], key=lambda r: -r["share"])
        change(rows[0], rows[1])

    return table(both_rows)


def swap_keys(a: dict, b: dict, key: str) -> None:
    a[key], b[key] = b[key], a[key]


def pose_and_what_follows(r: dict) -> None:
    moved_by = np.eye(4)
    moved_by[0, 3] = 0.5
    world = np.array(r["world_from_model"])
    camera = np.array(r["camera_from_model_opencv"]) @ np.linalg.inv(world)
    r["world_from_model"] = (moved_by @ world).tolist()
    r["camera_from_model_opencv"] = (camera @ moved_by @ world).tolist()


def eyes_exchanged(view: Path) -> None:
    """Exchange all files of the two eyes of a pair."""
    right = view.parent / f"{view.name}_right"
    spare = view.parent / "spare"
    view.rename(spare)
    right.rename(view)
    spare.rename(right)

    def exchange(cameras: dict) -> None:
        rows = {r["id"]: r for r in cameras["views"]}
        swap_keys(rows[view.name], rows[right.name], "world_from_camera_opengl")

    document("cameras.json", exchange)(view)


def camera_of_the_view_moved(view: Path) -> None:
    """Move the camera of the rendered view in cameras.json, not in view.json."""

    def move(cameras: dict) -> None:
        row = next(row for row in cameras["views"] if row["id"] == view.name)
        row["world_from_camera_opengl"][0][3] = 1.0

    document("cameras.json", move)(view)


def pictures_of_eyes(view: Path) -> None:
    """Exchange light and developed pictures of the two eyes."""
    right = view.parent / f"{view.name}_right"
    for file in ("radiance.exr", "mlt_ol.png", "mlt_il_ol.png"):
        first, second = (view / file).read_bytes(), (right / file).read_bytes()
        (view / file).write_bytes(second)
        (right / file).write_bytes(first)
    names = ("mlt_ol", "mlt_il_ol")
    tables = [json.loads((v / "view.json").read_text()) for v in (view, right)]
    for name in names:
        swap_keys(tables[0]["modes"]["develop"], tables[1]["modes"]["develop"], name)
    for folder, changed in zip((view, right), tables, strict=True):
        (folder / "view.json").write_text(json.dumps(changed))


def light(change: Callable[[dict[str, np.ndarray]], object]) -> Plant:
    """Change the planes of radiance.exr, and develop its pictures and facts again."""

    def plant(view: Path) -> None:
        planes = dict(layers_from_exr((view / "radiance.exr").read_bytes()))
        change(planes)
        planes = {n: np.ascontiguousarray(p, np.float32) for n, p in planes.items()}
        (view / "radiance.exr").write_bytes(exr_from_layers(planes))
        develop_again(view)

    return plant


def develop_again(view: Path) -> None:
    """Do the steps after light again, so that pictures, shading, histogram and facts agree with radiance.exr."""
    root, house = view.parents[3], view.parents[1].name
    recipe = recipe_from_json((root / "recipe.json").read_bytes(), "recipe.json")
    for step in ("develop", "view"):
        marker = view.parents[1] / f"done/{step}.{view.name}.json"
        layers = tuple(json.loads(marker.read_text())["facts"].get("layers", ()))
        marker.unlink()
        store, cache = FolderStore(root), HouseCache()
        run_step(step, Work(store, recipe, house, cache, view_id=view.name, layers=layers))


def light_planes(planes: dict[str, np.ndarray], *names: str) -> list[str]:
    """Channels of the named light groups and their diffuse light, by default of all groups and lamps."""
    chosen = names or ("outdoor", "indoor", "lamp")
    return [n for n in planes if n.removeprefix("diffuse_").startswith(chosen)]


def each(change: Callable[[np.ndarray], np.ndarray], *names: str) -> Plant:
    """Light of some groups changed, and developed again."""
    return light(lambda p: p.update({n: change(p[n]) for n in light_planes(p, *names)}))


def of_other_view(*, with_guides: bool) -> Plant:
    """The light of another view of the home, with its guides or under the view's own."""

    def plant(view: Path) -> None:
        neighbour = max(v for v in view.parent.iterdir() if v != view)
        theirs = layers_from_exr((neighbour / "radiance.exr").read_bytes())
        names = list(theirs) if with_guides else light_planes(dict(theirs))
        light(lambda p: p.update({n: theirs[n] for n in names}))(view)

    return plant


def rows_exchanged(array: np.ndarray) -> np.ndarray:
    """Rows exchanged in pairs."""
    return array.reshape(-1, 2, *array.shape[1:])[:, ::-1].reshape(array.shape)


def darker_patch(array: np.ndarray) -> np.ndarray:
    """A patch in the middle, a fifth of the picture's width and height, at 0.3 of its light."""
    new, (h, w) = array.copy(), array.shape
    new[h // 3 : h * 8 // 15, w // 3 : w * 8 // 15] *= 0.3
    return new


def doubled(colour: str, *names: str) -> Plant:
    """One colour of some light groups twice as bright."""
    return light(
        lambda p: p.update({n: 2 * p[n] for n in light_planes(p, *names) if n.endswith(colour)})
    )


def exchange_groups(planes: dict[str, np.ndarray]) -> None:
    for c in "RGB":
        swap_keys_of(planes, f"outdoor.{c}", f"indoor.{c}")


def swap_keys_of(planes: dict, a: str, b: str) -> None:
    planes[a], planes[b] = planes[b], planes[a]


def exchange_lamps(view: Path) -> None:
    """Exchange the layers and stated shares of the two brightest lamps."""
    rows = json.loads((view / "view.json").read_text())["modes"]["light"]["lamps"]
    first, second = sorted(rows, key=lambda r: -r["share"])[:2]

    def change(planes: dict[str, np.ndarray]) -> None:
        for c in "RGB":
            swap_keys_of(planes, f"{first['layer']}.{c}", f"{second['layer']}.{c}")
            # Their sum is in the order of their numbers, exact to the bit.
            layers = [r["layer"] for r in rows if r["layer"]]
            total = np.zeros_like(planes[f"indoor.{c}"])
            for name in layers:
                total += planes[f"{name}.{c}"]
            planes[f"indoor.{c}"] = total

    light(change)(view)
    shares = {first["number"]: second["share"], second["number"]: first["share"]}

    def tell(facts: dict) -> None:
        for r in facts["lamps"]:
            r["share"] = shares.get(r["number"], r["share"])

    table(lambda t: tell(t["modes"]["light"]))(view)
    document(f"done/light.{view.name}.json", lambda m: tell(m["facts"]))(view)


def of_another_hour(view: Path) -> None:
    """The light of the same view with the sun behind the house."""
    with tempfile.TemporaryDirectory() as name:
        root = Path(name) / "root"
        sunlit(165.0)(root)
        (file,) = root.glob(f"houses/*/views/{view.name}/radiance.exr")
        shutil.copy(file, view / "radiance.exr")
    develop_again(view)


_FINISHED: dict[str, tuple[Plant, str]] = {
    "box3d moved by 5 cm": (row(move_box), "box3d"),
    "box3d grown": (row(lambda r: r["box3d"]["half"].__setitem__(1, r["box3d"]["half"][1] + 0.03)), "box3d"),
    "box3d turned": (row(turn_box), "box3d"),
    "visible_fraction changed": (row(other_share), "visible_fraction"),
    "truncated changed": (row(lambda r: r.update(truncated=not r["truncated"])), "truncated"),
    "pixels changed": (row(lambda r: r.update(pixels=r["pixels"] + 1)), "table"),
    "fraction changed": (row(lambda r: r.update(fraction=r["fraction"] * 1.01)), "table"),
    "box2d changed": (row(lambda r: r["box2d"].__setitem__(0, r["box2d"][0] + 1)), "table"),
    "class changed": (row(lambda r: r.update(nyu40=35, **{"class": "lamp"})), "semantic = table"),
    "an instance left out": (table(lambda t: t["instances"].pop()), "table"),
    "camera moved by 2 cm": (pose(step_aside), "ray: depth"),
    "focal length changed": (table(lambda t: t["K"][0].__setitem__(0, t["K"][0][0] * 1.02)), "ray: depth"),
    "depth scaled": (picture("depth.png", scaled(1.01)), "ray: depth"),
    "depth patched": (picture("depth.png", patch(30)), "ray: depth"),
    "normals mirrored": (picture("normal.png", lambda a: np.dstack([65535 - a[..., 0], a[..., 1:]])), "ray: normal"),
    "instances swapped": (swapped_ids, "ray: instance"),
    "semantic patched": (picture("semantic.png", patch(1)), "ray: semantic"),
    "boundary moved": (picture("boundary.png", lambda a: np.roll(a, 1, 1)), "boundary"),
    "valid patched": (picture("valid.png", lambda a: a * (np.arange(a.shape[1]) > 10)), "ray: valid"),
    "depth_z scaled": (exr("depth_z.exr", scaled(1.002)), "ray: depth_z"),
    "position moved": (exr("position.exr", lambda a: a + 0.01), "ray: position"),
    "normal_world turned": (picture("normal_world.png", lambda a: a[..., [2, 1, 0]]), "ray: normal_world"),
    "material renumbered": (picture("material.png", lambda a: a + 1), "ray: material"),
    "nyu13 patched": (picture("nyu13.png", patch(1)), "nyu13"),
    "glass patched": (picture("glass.png", patch(255)), "ray: glass"),
    "behind glass moved": (picture("behind_glass/depth.png", scaled(1.02)), "ray: behind glass depth"),
    "mirror patched": (picture("mirror.png", patch(255)), "ray: mirror"),
    "behind mirror moved": (picture("behind_mirror/depth.png", scaled(1.02)), "ray: behind mirror depth"),
    "roughness scaled": (picture("roughness.png", scaled(0.97)), "ray: roughness"),
    "metallic patched": (picture("metallic.png", patch(255)), "ray: metallic"),
    "f0 patched": (picture("f0.png", patch(60)), "ray: f0"),
    "shading scaled": (exr("shading.exr", scaled(1.02)), "intrinsic sum"),
    "shading by lamps mirrored": (exr("shading_indoor.exr", mirrored), "shading"),
    "residual upside down": (exr("residual.exr", lambda a: a[::-1]), "intrinsic sum"),
    "residual by day scaled": (exr("residual_outdoor.exr", scaled(1.1)), "intrinsic sum"),
    "shading brighter, residual darker": (brighter_shading, "shading"),
    "shading brighter, and the light that it is made of": (brighter_diffuse_light, "matte surfaces"),
    "missing shading in the table": (
        table(lambda t: t["modes"]["develop"].update(layers=["shading"])), "intrinsic layers",
    ),
    "source's class patched": (picture("class_source.png", patch(1)), "class_source"),
    "semantic boundary moved": (picture("boundary_semantic.png", lambda a: np.roll(a, 1, 0)), "boundary_semantic"),
    "albedo patched": (picture("albedo.png", patch(40)), "ray: albedo"),
    "albedo scaled": (picture("albedo.png", scaled(0.95)), "ray: albedo"),
    "hha of another height": (picture("hha.png", lambda a: a + np.array([0, 4, 0])), "hha"),
    "Kinect's depth scaled": (picture("depth_sensor.png", scaled(1.03)), "depth_sensor: values"),
    "Kinect's depth without its noise": (
        lambda view: shutil.copy(view / "depth.png", view / "depth_sensor.png"), "depth_sensor: values",
    ),
    "time of flight scaled": (picture("depth_sensor_tof.png", scaled(1.05)), "depth_sensor_tof: values"),
    "stereo's depth scaled": (picture("depth_sensor_stereo.png", scaled(1.02)), "depth_sensor_stereo: values"),
    "depth of the second surface moved": (picture("depth_layers/depth.png", moved_surface), "depth layers"),
    "class of the second surface exchanged": (picture("depth_layers/semantic.png", other_surface), "depth layers"),
    "instance of a surface exchanged": (picture("depth_layers/instance.png", other_surface), "depth layers"),
    "clear surfaces opaque": (picture("depth_layers/clear.png", scaled(0)), "depth layers"),
    **{
        f"{name}'s holes exchanged": (picture(f"depth_hole{name}.png", exchanged_holes), "depth holes")
        for name in ("", "_tof", "_stereo", "_d455", "_azure", "_l515")
    },
    "a hole hidden": (picture("depth_hole_tof.png", lambda a: np.where(a == 1, 0, a)), "depth holes"),
    "light mirrored": (picture("mlt_il_ol.png", mirrored), "light developed"),
    "light brightened": (picture("mlt_il_ol.png", scaled(1.05)), "light developed"),
    "light patched": (picture("mlt_ol.png", patch(20)), "light developed"),
    "light brightened, and its facts": (brighter_with_its_facts, "light developed"),
    "radiance of one colour scaled": (
        exr("radiance.exr", lambda a: a * (1 + np.arange(a.shape[1]) / 320)), "light developed",
    ),
    "OpenGL mirrored": (picture("opengl_dl.png", mirrored), "opengl edges"),
    "OpenGL of lamps upside down": (picture("opengl_il.png", lambda a: a[::-1]), "opengl edges"),
    "OpenGL moved by 3 px": (picture("opengl_dl.png", lambda a: np.roll(a, 3, 1)), "opengl edges"),
    "histogram of colours changed": (histogram(lambda h: move_count(h["colour"]["mlt_il_ol"])), "histogram"),
    "histogram of depth changed": (histogram(lambda h: move_count(h["depth"])), "histogram"),
    "brightness changed": (histogram(lambda h: h["picture"]["mlt_ol"].update(brightness=0.5)), "histogram"),
    "number of objects changed": (histogram(lambda h: h["scene"].update(n_objects=99)), "histogram"),
}  # fmt: skip


_CAMERAS: dict[str, tuple[Plant, str]] = {
    "tone changed in the table": (
        table(lambda t: t["modes"]["develop"]["variants"][0]["tone"].update(contrast=1.0)), "light developed",
    ),
    "camera changed in the table": (
        table(lambda t: t["modes"]["develop"]["variants"][0].update(camera="none")), "light developed",
    ),
    "a camera in the table without a draw": (
        table(lambda t: t["modes"]["develop"].update(tone={"contrast": 1.2})), "light developed",
    ),
    "a variant mirrored": (picture("mlt_il_ol.2.png", mirrored), "light developed"),
    "a variant too many": (
        lambda view: shutil.copy(view / "mlt_il_ol.1.png", view / "mlt_il_ol.4.png"), "light developed",
    ),
}  # fmt: skip


_FINISHED |= {
    # Facts of view.json that other files repeat, or that follow from others.
    "house changed in the table": (table(lambda t: t.update(house="elsewhere")), "facts"),
    "view changed in the table": (table(lambda t: t.update(view="0_1_1")), "facts"),
    "room changed in the table": (table(lambda t: t.update(room="0_1")), "camera file"),
    "sector changed in the table": (table(lambda t: t.update(sector=t["sector"] + 1)), "camera file"),
    "origin changed in the table": (table(lambda t: t.update(origin="stored")), "camera file"),
    "score changed in the table": (table(lambda t: t.update(score=t["score"] + 0.1)), "camera file"),
    "recipe changed in the table": (table(lambda t: t.update(recipe=t["recipe"][::-1])), "recipe"),
    "a row's name": (row(lambda r: r.update(name="sofa")), "names"),
    "a row's kind": (row(lambda r: r.update(kind="object")), "names"),
    "a row's item": (row(lambda r: r.update(item="piece_99")), "names"),
    "a row's room": (row(lambda r: r.update(room="0_9")), "names"),
    "a row's class13": (row(lambda r: r.update(class13="bed")), "names"),
    "a row's nyu13": (row(lambda r: r.update(nyu13=1)), "names"),
    "a row's source class": (row(lambda r: r.update(source_class="builtin#tv")), "names"),
    "a row marked as floating": (row(lambda r: r.update(floating=True)), "names"),
    "a standing item marked as floating": (document("house.json", lambda h: next(i for i in h["items"] if i["kind"] == "object")["tags"].append("floating")), "floating"),
    "a row given a pose": (row(lambda r: r.update(model="m", world_from_model=np.eye(4).tolist(), camera_from_model_opencv=np.eye(4).tolist())), "model poses"),
    "two materials exchanged": (table(lambda t: t["materials"].update({"1": t["materials"]["2"], "2": t["materials"]["1"]})), "tables"),
    "a material's kind": (table(lambda t: t["materials"]["1"].update(kind="mirror")), "tables"),
    "a source class renamed": (table(lambda t: t["source_classes"].update({"1": "zebra"})), "tables"),
    "a corner of the room moved": (table(lambda t: t["layout"][0]["world"].__setitem__(0, 0.2)), "layout"),
    "a corner's pixel moved": (table(lambda t: next(r for r in t["layout"] if r["pixel"])["pixel"].__setitem__(0, 3.0)), "layout"),
    "a hidden corner marked visible": (table(lambda t: next(r for r in t["layout"] if not r["visible"]).update(visible=True)), "layout"),
    "a layout without its ceiling": (table(lambda t: t.update(layout=t["layout"][: len(t["layout"]) // 2])), "layout"),
    "warnings replaced": (table(lambda t: t.update(warnings=["all is well"])), "light facts"),
    # Facts of light.
    "seed of light": (table(lambda t: t["modes"]["light"].update(seed=1)), "light facts"),
    "floor_lux": (table(lambda t: t["modes"]["light"]["floor_lux"].update(indoor=300.0)), "light facts"),
    "the sun of another hour": (table(lambda t: t["modes"]["light"]["sky"].update(sun_direction=[0.0, 0.6, 0.8])), "light facts"),
    "the sun of another hour, everywhere": (
        both(
            table(lambda t: t["modes"]["light"]["sky"].update(sun_direction=[0.0, 0.6, 0.8], sun_elevation_deg=36.87)),
            document("illuminance.json", lambda h: h["sky"].update(sun_direction=[0.0, 0.6, 0.8], sun_elevation_deg=36.87)),
        ), "sky",
    ),
    "sky's lux": (table(lambda t: t["modes"]["light"]["sky"].update(sky_lx=5000.0)), "light facts"),
    "the sun's lux, everywhere": (
        both(
            table(lambda t: t["modes"]["light"]["sky"].update(sun_lx=90000.0)),
            document("illuminance.json", lambda h: h["sky"].update(sun_lx=90000.0)),
        ), "sky",
    ),
    "samples a pixel": (table(lambda t: t["modes"]["light"].update(spp=512)), "light facts"),
    "integrator": (table(lambda t: t["modes"]["light"].update(integrator="pssmlt-camera")), "light facts"),
    "marked as denoised": (table(lambda t: t["modes"]["develop"].update(denoised=True)), "light facts"),
    "weights of lamps": (table(lambda t: t["modes"]["light"]["lamp_weights"].update(piece_5=0.9)), "light facts"),
    "noise": (table(lambda t: t["modes"]["light"]["noise"].update(sum=0.01)), "histogram"),
    # Files of the house.
    "lux of a room": (document("illuminance.json", lambda h: h["rooms"][0].update(indoor_lx=500.0)), "light facts"),
    "a room's warning hidden": (document("illuminance.json", lambda h: h["rooms"][0].update(warnings=["dark"])), "illuminance"),
    "a room lit by another light": (document("illuminance.json", lambda h: h["rooms"][0].update(lit_by=["sky"])), "illuminance"),
    "camera of cameras.json moved": (camera_of_the_view_moved, "camera file"),
    "camera of a view that is not rendered moved": (document("cameras.json", lambda h: h["views"][0]["world_from_camera_opengl"][0].__setitem__(3, 1.0)), "choice"),
    "focal length of a view that is not rendered": (document("cameras.json", lambda h: h["views"][0]["intrinsics"].update(fx=200.0)), "choice"),
    "objects of a view that is not rendered": (document("cameras.json", lambda h: h["views"][0]["objects"].update({"21": 9})), "choice"),
    "a view left out of cameras.json": (document("cameras.json", lambda h: h["views"].pop(0)), "choice"),
    "candidates of a sector": (document("cameras.json", lambda h: h["report"]["rooms"][0]["sectors"][0].update(n_candidates=999)), "choice"),
    "the score that won": (document("cameras.json", lambda h: h["report"]["rooms"][0]["sectors"][0].update(winner_score=9.0)), "choice"),
    "an item renamed": (document("house.json", lambda h: h["items"][20].update(name="zebra")), "house items"),
    "an item of another class": (document("house.json", lambda h: h["items"][20].update({"nyu40": 5, "class": "chair"})), "house items"),
    "an item's box moved": (document("house.json", lambda h: next(i for i in h["items"] if i["box"])["box"]["centre"].__setitem__(0, 0.0)), "house items"),
    "two items exchanged": (document("house.json", lambda h: h["items"].insert(0, h["items"].pop(1))), "house items"),
    "a room's polygon stretched": (document("house.json", lambda h: h["rooms"][0]["polygon"][1].__setitem__(0, 5.5)), "rooms"),
    "a room renamed": (document("house.json", lambda h: h["rooms"][0].update(name="Kitchen")), "rooms"),
    "a floor lowered": (document("house.json", lambda h: h["rooms"][0].update(floor_y=-0.3)), "rooms"),
    "a material's colour": (document("house.json", lambda h: h["materials"][5].update(diffuse=[0.1, 0.2, 0.9])), "materials"),
    "a material's roughness": (document("house.json", lambda h: h["materials"][5].update(roughness=0.11)), "materials"),
    "a material's texture": (document("house.json", lambda h: h["materials"][5].update(texture_id=h["textures"][1]["key"])), "materials"),
    "a material renamed": (document("house.json", lambda h: h["materials"][5].update(name="gold")), "materials"),
    "an opening turned": (document("house.json", lambda h: h["openings"][0].update(normal=[0.0, 0.0, 1.0])), "openings"),
    "a window marked as a door": (document("house.json", lambda h: next(o for o in h["openings"] if o["is_window"]).update(is_window=False)), "openings"),
    "a light moved": (document("house.json", lambda h: next(i for i in h["items"] if i["lights"])["lights"][0]["position"].__setitem__(1, 0.2)), "lights"),
    "a light's escape": (document("house.json", lambda h: next(i for i in h["items"] if i["id"] == "piece_5")["lights"][0].update(escape=0.9)), "lights"),
    "a licence changed": (document("house.json", lambda h: h["source"].update(licence="CC0")), "credits"),
    "a credit emptied": (glb(without_credit), "credits"),
    "the street's nodes out of the scene": (glb(scene_without_outside), "house items"),
    "a node moved": (glb(lambda h: h["nodes"][10].update(translation=[0.5, 0.0, 0.0])), "house items"),
    "a node of another item": (glb(lambda h: h["nodes"][10]["extras"].update(item="wall_0")), "house items"),
    "a surface of another material": (glb(lambda h: h["meshes"][10]["primitives"][0].update(material=3)), "house items"),
    "a material of house.glb painted": (glb(lambda h: h["materials"][4]["pbrMetallicRoughness"].update(baseColorFactor=[0.9, 0.1, 0.1, 1.0])), "materials"),
    "area of a room in repair.json": (document("repair.json", lambda h: h["rooms"][0].update(floor_area_m2=12.0)), "rooms"),
    "a room marked as open": (document("repair.json", lambda h: h["rooms"][0].update(enclosure="open")), "rooms"),
    "a field of the recipe": (document("recipe.json", lambda h: h["repair"].update(wall_thickness_m=0.2)), "recipe"),
    "the recipe's tone": (document("recipe.json", lambda h: h["tone"].update(key=0.25)), "light developed"),
    "seed of the recipe": (document("recipe.json", lambda h: h.update(seed=3)), "recipe"),
    "spp of the recipe": (document("recipe.json", lambda h: h["light"].update(spp=64)), "light facts"),
    "a histogram of another room": (histogram(lambda h: h.update(room_type="Kitchen")), "histogram"),
    "a pair's common share": (pairs(lambda rows: rows[3].update(common=0.9)), "pairs"),
    "a pair's base line": (pairs(lambda rows: rows[3].update(baseline_m=4.0)), "pairs"),
    "a pair's angle": (pairs(lambda rows: rows[3].update(angle_deg=99.0)), "pairs"),
    "shares of a pair": (pairs(lambda rows: [r.update(a_in_b=0.9, common=(0.9 + r["b_in_a"]) / 2) for r in rows]), "pairs"),
    "a pair left out": (pairs(lambda rows: rows.pop()), "pairs"),
    "missing textures": (histogram(lambda h: h["scene"].update(missing_textures=3)), "histogram"),
    "a histogram of another view": (histogram(lambda h: h.update(view="0_1_1")), "histogram"),
}  # fmt: skip

_FILM: dict[str, tuple[Plant, str]] = {
    "time of a frame": (table(lambda t: t.update(time_s=t["time_s"] + 0.02)), "camera file"),
    "times of all frames": (document("cameras.json", lambda h: [v.update(time_s=2 * v["time_s"]) for v in h["views"]]), "sequence"),
    "number of a frame": (table(lambda t: t.update(frame=t["frame"] + 1)), "camera file"),
    "next frame changed": (table(lambda t: t["partners"]["next"].update(view="frame_00009")), "partners"),
    "time of the next frame": (table(lambda t: t["partners"]["next"].update(time_s=0.5)), "partners"),
    "pose of the next frame": (table(lambda t: t["partners"]["next"]["world_from_camera_opencv"][0].__setitem__(3, 0.0)), "partners"),
    "rolling shutter's time": (document("recipe.json", lambda h: h["blur"].update(rolling_s=0.001)), "recipe"),
    "flow scaled": (exr("flow_forward.exr", scaled(1.05)), "motion: flow_forward"),
    "flow turned": (exr("flow_forward.exr", scaled(-1)), "motion: flow_forward"),
    "occlusion cleared": (picture("occlusion_forward.png", scaled(0)), "motion: occlusion_forward"),
    "KITTI's flow moved": (picture("flow_forward_kitti.png", lambda a: a + np.array([64, 0, 0])), "motion: flow_forward_kitti"),
    "labels of the next frame": (of_neighbour("depth.png", "normal.png", "instance.png", "semantic.png", "boundary.png", "valid.png"), "ray: depth"),
}  # fmt: skip

_PAIR: dict[str, tuple[Plant, str]] = {
    "disparity scaled": (picture("disparity.png", scaled(1.05)), "motion: disparity"),
    "eye changed": (table(lambda t: t["partners"]["stereo"].update(view="0_1_0")), "partners"),
    "K of the other eye": (table(lambda t: t["partners"]["stereo"]["K"][0].__setitem__(0, 99.0)), "partners"),
    "the base line": (document("recipe.json", lambda h: h["cameras"].update(stereo_m=0.12)), "sequence"),
    "the eyes of a pair exchanged": (eyes_exchanged, "sequence"),
}  # fmt: skip

_LAMPS: dict[str, tuple[Plant, str]] = {
    "shares of two lamps exchanged": (lamps(lambda a, b: swap_keys(a, b, "share")), "lamps"),
    "layers of two lamps exchanged": (lamps(lambda a, b: swap_keys(a, b, "layer")), "lamps"),
    "a lamp's flux": (lamps(lambda a, b: a.update(lm=100.0)), "lamps"),
    "a lamp's name": (lamps(lambda a, b: a.update(name="sun")), "lamps"),
    "a lamp's item": (lamps(lambda a, b: swap_keys(a, b, "item")), "lamps"),
    "a lamp's number": (lamps(lambda a, b: swap_keys(a, b, "number")), "lamps"),
    "a lamp's instance": (lamps(lambda a, b: swap_keys(a, b, "instance")), "lamps"),
    "a lamp's room": (lamps(lambda a, b: a.update(room="0_9")), "lamps"),
    "a lamp left out": (table(lambda t: t["modes"]["light"]["lamps"].pop()), "lamps"),
}  # fmt: skip

_EDITED: dict[str, tuple[Plant, str]] = {
    "camera_from_model_opencv moved": (placed(moved("camera_from_model_opencv", 1.0)), "model poses"),
    "world_from_model moved": (placed(moved("world_from_model", 1.0)), "model poses"),
    "both poses of a model moved": (placed(pose_and_what_follows), "model poses"),
    "both poses and house.json's moved": (
        both(placed(pose_and_what_follows), document("house.json", lambda h: moved("world_from_model", 0.5)(next(i for i in h["items"] if i["pose"])["pose"]))), "model poses",
    ),
    "model changed": (placed(lambda r: r.update(model="teapot")), "model poses"),
    "a model's pose left out": (placed(lambda r: [r.pop(k) for k in ("model", "world_from_model", "camera_from_model_opencv")]), "model poses"),
    "nocs mirrored": (picture("nocs.png", lambda a: np.where(a.any(-1, keepdims=True), 65535 - a, 0)), "ray: nocs"),
}  # fmt: skip


def parts(change: Callable[[dict], object]) -> Plant:
    """Change the row of the largest part in articulation.json."""

    return json_file(
        "articulation.json", lambda h: change(max(h["parts"], key=lambda r: r["pixels"]))
    )


def joint(change: Callable[[dict], object]) -> Plant:
    """Change the joint of the open door in house.json."""

    def open_one(house: dict) -> dict:
        joints = [j for i in house["items"] for j in i.get("joints", [])]
        return next(j for j in joints if j["value"] > 0)

    return document("house.json", lambda h: change(open_one(h)))


def alike(change: Callable[[dict], object]) -> Plant:
    """Change the joint of the open door in house.json, and what articulation.json repeats of it."""

    def plant(view: Path) -> None:
        joint(change)(view)
        home = json.loads((view.parents[1] / "house.json").read_text())
        joints = [j for i in home["items"] for j in i.get("joints", [])]
        pose = np.array(json.loads((view / "view.json").read_text())["world_from_camera_opencv"])

        def repeat(table: dict) -> None:
            for r in table["parts"]:
                j = joints[r["id"] - 1]
                r.update({k: j[k] for k in ("kind", "value", "lower", "upper", "mass_kg")})
                r["axis_opencv"] = (np.array(j["axis"]) @ pose[:3, :3]).tolist()
                away = np.array(j["point"]) - pose[:3, 3]
                r["point_opencv"] = (away @ pose[:3, :3]).tolist()

        json_file("articulation.json", repeat)(view)

    return plant


def moving(change: Callable[[dict], object]) -> Plant:
    """Change the first moving primitive of house.glb."""

    def first(h: dict) -> dict:
        primitives = [p for m in h["meshes"] for p in m["primitives"]]
        return next(p for p in primitives if "part" in p.get("extras", {}))

    return glb(lambda h: change(first(h)))


_OPENED: dict[str, tuple[Plant, str]] = {
    "a door that does not move": (picture("part.png", lambda a: np.where(a > 0, 0, a)), "ray: part"),
    "parts moved": (picture("part.png", lambda a: np.roll(a, 3, 1)), "ray: part"),
    "a joint's axis in the camera's frame": (parts(lambda r: r.update(axis_opencv=[1.0, 0.0, 0.0])), "articulation"),
    "a point of its axis": (parts(lambda r: r["point_opencv"].__setitem__(2, 9.0)), "articulation"),
    "how far a part is open": (parts(lambda r: r.update(value=0.1)), "articulation"),
    "the limit of a part": (parts(lambda r: r.update(upper=3.0)), "articulation"),
    "mass of a part": (parts(lambda r: r.update(mass_kg=1.0)), "articulation"),
    "a part of another item": (parts(lambda r: r.update(item="piece_1")), "articulation"),
    "pixels of a part": (parts(lambda r: r.update(pixels=r["pixels"] + 1)), "articulation"),
    "box of a part": (parts(lambda r: r["box2d"].__setitem__(0, 0)), "articulation"),
    "a door of house.json beyond its limit": (joint(lambda j: j.update(value=2.5)), "joints"),
    "a hinge of house.json elsewhere": (joint(lambda j: j["point"].__setitem__(0, 20.0)), "joints"),
    "an invalid axis in house.json": (joint(lambda j: j.update(axis=[0.0, 2.0, 0.0])), "joints"),
    "another kind of joint": (joint(lambda j: j.update(kind="ball")), "joints"),
    "everywhere alike: axis negated": (alike(lambda j: j.update(axis=[-a for a in j["axis"]])), "joints"),
    "everywhere alike: value halved": (alike(lambda j: j.update(value=j["value"] / 2)), "joints"),
    "everywhere alike: hinge 4 cm beside": (alike(lambda j: j["point"].__setitem__(0, j["point"][0] + 0.04)), "joints"),
    "everywhere alike: hinge 4 cm before": (alike(lambda j: j["point"].__setitem__(2, j["point"][2] + 0.04)), "joints"),
    "everywhere alike: limit x 1.4": (alike(lambda j: j.update(upper=j["upper"] * 1.4)), "joints"),
    "everywhere alike: limit - 0.3 rad": (alike(lambda j: j.update(upper=j["upper"] - 0.3)), "joints"),
    "everywhere alike: lower limit - 0.3 rad": (alike(lambda j: j.update(lower=-0.3)), "joints"),
    "everywhere alike: mass x 10": (alike(lambda j: j.update(mass_kg=j["mass_kg"] * 10)), "joints"),
    "everywhere alike: a slide": (alike(lambda j: j.update(kind="prismatic")), "joints"),
    "mass of an unseen joint": (document("house.json", lambda h: next(j for i in h["items"] for j in i.get("joints", []) if j["value"] == 0).update(mass_kg=50.0)), "joints"),
    "a part of house.glb renamed": (moving(lambda p: p["extras"].update(part="lid 1")), "joints"),
    "a part of house.glb marked static": (moving(lambda p: p.pop("extras")), "joints"),
}  # fmt: skip

_FINISHED |= {
    # Light that contradicts the labels, developed again.
    "radiance of another view": (of_other_view(with_guides=True), "light guides"),
    "light of another view": (of_other_view(with_guides=False), "light edges"),
    "light mirrored, developed": (each(mirrored), "light edges"),
    "light upside down, developed": (each(lambda a: a[::-1]), "light edges"),
    "light turned, developed": (each(lambda a: a[::-1, ::-1]), "light edges"),
    "light moved by 4 px, developed": (each(lambda a: np.roll(a, 4, 1)), "light edges"),
    "outdoor light mirrored, developed": (each(mirrored, "outdoor"), "light edges"),
    "indoor light mirrored, developed": (each(mirrored, "indoor"), "light edges"),
    "light of one colour all over": (each(lambda a: np.full_like(a, a.mean())), "light edges"),
    "light with its rows exchanged in pairs": (each(rows_exchanged), "light edges"),
    "light with its columns exchanged in pairs": (each(lambda a: rows_exchanged(a.T).T), "light edges"),
    "light with a darker patch": (each(darker_patch), "light traced"),
    "green light doubled": (doubled(".G"), "light traced"),
    "blue light of lamps doubled": (doubled(".B", "indoor"), "light traced"),
    "red daylight doubled": (doubled(".R", "outdoor"), "light traced"),
    "lamps of half the light": (each(scaled(0.5), "indoor"), "light traced"),
    "daylight of half the light": (each(scaled(0.5), "outdoor"), "light traced"),
    "outdoor and indoor light exchanged": (light(exchange_groups), "colours of light"),
    "guides mirrored": (light(lambda p: p.update({n: a[:, ::-1] for n, a in p.items() if n[0] in "an"})), "light guides"),
    "normal guides of another frame": (light(lambda p: swap_keys_of(p, "normal.X", "normal.Z")), "light guides"),
    "albedo guide flattened": (light(lambda p: p.update({n: np.full_like(a, 0.5) for n, a in p.items() if n.startswith("albedo")})), "light guides"),
}  # fmt: skip

_FINISHED |= {
    "occlusion moved": (picture("boundary_occlusion.png", lambda a: np.roll(a, 2, 1)), "boundary_occlusion"),
    "occlusion of the other side": (picture("boundary_occlusion.png", lambda a: np.where(a > 0, 383 - a, 0)), "boundary_occlusion"),
    "occlusion left out": (picture("boundary_occlusion.png", scaled(0)), "boundary_occlusion"),
    "creases moved": (picture("boundary_crease.png", lambda a: np.roll(a, 2, 0)), "boundary_crease"),
    "creases left out": (picture("boundary_crease.png", scaled(0)), "boundary_crease"),
    "shading normals mirrored": (picture("normal_shading.png", lambda a: np.dstack([65535 - a[..., 0], a[..., 1:]])), "ray: normal_shading"),
    "shading normals turned by 3 degrees": (picture("normal_shading.png", turned_by(3)), "ray: normal_shading"),
    "projector's dots moved": (picture("projector.png", lambda a: np.roll(a, 2, 1)), "projector"),
    "projector's dots of half the light": (picture("projector.png", scaled(0.7)), "projector"),
    "projector's dots left out": (picture("projector.png", scaled(0)), "projector"),
}  # fmt: skip

_LIT_FLOOR: dict[str, tuple[Plant, str]] = {
    # Powers of two, so that the indoor light stays the exact sum of its lamps.
    "lamps of eight times the light": (each(scaled(8), "indoor", "lamp"), "levels"),
    "lamps of an eighth of the light": (each(scaled(0.125), "indoor", "lamp"), "lamplight"),
    "daylight of ten times the light": (each(scaled(10), "outdoor"), "levels"),
    "outdoor light with a darker patch": (each(darker_patch, "outdoor"), "light traced"),
    "layers of two lamps exchanged, and their shares": (exchange_lamps, "lamplight"),
}

_PAIR |= {"pictures of the eyes exchanged": (pictures_of_eyes, "light guides")}

_SUN: dict[str, tuple[Plant, str]] = {
    "light of another hour": (of_another_hour, "sun"),
    "the sun moved in the table": (
        table(lambda t: t["modes"]["light"]["sky"].update(sun_direction=[0.224144, 0.5, 0.836516])), "sun",
    ),
}  # fmt: skip

_SENSOR: dict[str, tuple[Plant, str]] = {
    "camera of a picture changed": (table(lambda t: t["modes"]["develop"].update(camera="none")), "light developed"),
    "gains of a sensor": (table(lambda t: t["modes"]["develop"]["mlt_ol"].update(gains=[1.0, 1.0, 1.0])), "light developed"),
    "ISO of a sensor": (table(lambda t: t["modes"]["develop"]["mlt_ol"].update(iso=12345.0)), "light developed"),
    "shutter of a sensor": (table(lambda t: t["modes"]["develop"]["mlt_ol"].update(shutter_s=7.0)), "light developed"),
    "exposure of a sensor": (table(lambda t: t["modes"]["develop"]["mlt_il_ol"].update(exposure=0.001)), "light developed"),
}  # fmt: skip

_LENS: dict[str, tuple[Plant, str]] = {
    "guides of other materials than the published": (light(lambda p: p.update({n: a ** np.float32(2.2) for n, a in p.items() if n.startswith("albedo")})), "light guides"),
    "pixels that another field of view counts": (
        document("cameras.json", lambda h: [r.update(objects={k: round(n * 0.9) for k, n in r["objects"].items()}) for r in h["views"]]), "choice",
    ),
}  # fmt: skip

FALSEHOODS: dict[str, dict[str, tuple[Plant, str]]] = {
    "finished": _FINISHED, "cameras": _CAMERAS, "film": _FILM, "pair": _PAIR, "lamps": _LAMPS, "edited": _EDITED, "opened": _OPENED,
    "lit floor": _LIT_FLOOR, "sun": _SUN, "sensor": _SENSOR, "lens": _LENS,
}  # fmt: skip


def planted(root: Path, sort: str, kind: str) -> set[str]:
    """The failing checks after a falsehood is planted in a root of that sort, with its hashes updated."""
    plant, check = FALSEHOODS[sort][kind]
    plant(view_of(root))
    sign(root, house_of(root))
    counts = verify(root, tracer=LightAgain if check == "light traced" else None).counts
    return {name for name, count in counts.items() if count.failed}
