"""Planted falsehoods, false alarms and fields without a check: `make bench NAME=truth` -> out/bench/truth.json.

Also labels against closed forms: albedo, emitters, boxes. Effects: renders into a temporary folder.
"""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.figures import write_report
from pbrs_farm import cli
from pbrs_farm.assets import homes_package
from pbrs_farm.check import fields, methods, verify
from pbrs_farm.check.stored_set import stored_set
from pbrs_farm.core.frames import LM_PER_W, srgb_from_linear
from pbrs_farm.core.house import House, Material, corners_of_surfaces, geometry_from_house
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.prepare.finished_house import repaired_house
from pbrs_farm.prepare.source import resolve, variants
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.repair import repair
from pbrs_farm.run.light_again import LightAgain
from pbrs_farm.run.local import run_local
from pbrs_farm.run.local_run import Run
from pbrs_farm.run.plan import wanted
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.area_emitters import area_emitters_of_house
from pbrs_farm.transport.scene_tables.material_rows import max_albedo
from pbrs_farm.transport.scene_tables.sky import uniform_sky
from pbrs_farm.transport.validation import known_rooms as rooms
from pbrs_farm.truth.surface_layers import albedo_label
from tests.check.falsehoods import FALSEHOODS, planted
from tests.check.set_falsehoods import FORMS
from tests.check.set_falsehoods import KINDS as KINDS_OF_SETS
from tests.check.set_falsehoods import planted as planted_in_set
from tests.check.sorts_of_roots import ROOTS
from tests.read.gltf.gltf_scenes import read, two_rooms
from tests.sets.small_sets import small_set

MADE = ("made:1", "made:2")
N_DRAWN = 2  # example homes whose boxes are measured
UNITS = {
    "truth.planted_found": "kinds of falsehood found, all hashes mended",
    "truth.planted": "kinds planted",
    "truth.unowned_fields": "fields, files and layers of those roots and a set without a check and without a note that none checks them",
    "truth.false_alarms": "failed checks of true roots of every sort, --all --light",
    "truth.roots": "true roots",
    "truth.albedo_error": "of 255: light reflected by a textured floor under a white sky against its label, worst of five",
    "truth.emitter_error": "relative error of a glTF panel's radiance, worse of a white and a red one",
    "truth.box_error_mm": "mm, worst side of the worst box, two example homes dressed and two generated",
    "truth.box_items": "boxes measured",
    "truth.layers_union": "1: CLEAN with all layers after runs with others and without",
    "verify.cpu_s_view": "CPU-s of `verify` for a view of Studio at 640x480 in all modes, preview, mean of two",
}


def main() -> None:
    """Measure everything and write the report."""
    figures: dict[str, Any] = {}
    with tempfile.TemporaryDirectory(prefix="bench-truth-") as name:
        folder = Path(name)
        figures |= _true_roots(folder / "roots")
        n_found = _found(folder)
        n_kinds = sum(len(kinds) for kinds in FALSEHOODS.values()) + len(KINDS_OF_SETS)
        n_in_set, n_unowned = _of_set(folder / "set")
        n_found += n_in_set
        figures["truth.unowned_fields"] += n_unowned
        figures |= {"truth.planted_found": n_found, "truth.planted": n_kinds}
        figures["truth.albedo_error"] = round(_albedo_error(), 3)
        figures["truth.emitter_error"] = round(_emitter_error(), 5)
        figures["truth.layers_union"] = int(_is_union(folder / "union"))
        figures["verify.cpu_s_view"] = round(_verify_cpu_s(folder / "cost"), 2)
    worst, n = _box_errors()
    figures |= {"truth.box_error_mm": round(worst, 4), "truth.box_items": n}
    write_report("truth", figures, UNITS)


def _true_roots(folder: Path) -> dict[str, int]:
    """False alarms and unowned fields over roots of every sort, made below folder."""
    alarms, lacking, n_views = 0, set[tuple[str, str]](), 0
    for sort, make in ROOTS.items():
        root = folder / sort
        make(root)
        certificate = verify(root, all_pixels=True, tracer=LightAgain)
        n_views += certificate.n_views
        for failure in certificate.failures:
            print(f"false alarm in {sort}: {failure}", flush=True)
        alarms += sum(count.failed > 0 for count in certificate.counts.values())
        houses = list(root.glob("houses/*"))
        lacking |= set(fields.unowned(fields.stored_fields(root, houses)))
        lacking |= {(line, "") for line in methods.unknown_files([root, *houses])}
    lacking |= {(file, "") for file in methods.unowned_layers()}
    for file, field in sorted(lacking):
        print(f"no owner: {file} {field}")
    return {
        "truth.false_alarms": alarms, "truth.roots": len(ROOTS), "truth.unowned_fields": len(lacking),
    }  # fmt: skip


def _found(folder: Path) -> int:
    n = 0
    for sort, kinds in FALSEHOODS.items():
        for kind, (_plant, check) in kinds.items():
            root = folder / "planted"
            shutil.rmtree(root, ignore_errors=True)
            shutil.copytree(folder / "roots" / sort, root)
            is_found = check in planted(root, sort, kind)
            n += is_found
            if not is_found:
                print(f"not found: {sort}: {kind}", flush=True)
    return n


def _of_set(folder: Path) -> tuple[int, int]:
    """Kinds of falsehood found in a set, and fields of it without a row."""
    out, n = folder / "small", 0
    assert cli.main(["make", str(small_set(folder, FORMS, "128x96")), "--out", str(out)]) == 0
    stored = stored_set(out)
    assert stored is not None
    lacking = [
        pair for pair in fields.fields_of_set(stored) if fields.row_and_names(*pair)[0] is None
    ]
    for kind, (_plant, check) in KINDS_OF_SETS.items():
        shutil.rmtree(folder / "planted", ignore_errors=True)
        is_found = check in planted_in_set(shutil.copytree(out, folder / "planted"), kind)
        n += is_found
        if not is_found:
            print(f"not found: set: {kind}", flush=True)
    for file, field in lacking:
        print(f"no owner: {file} {field}")
    return n, len(lacking)


def _albedo_error() -> float:
    """Light reflected by a textured floor under a white sky against its label, of 255, worst of five textures."""
    recipe = recipe_from_name("fast")
    floor = rooms.quad([(-50, 0, -50), (-50, 0, 50), (50, 0, 50), (50, 0, -50)], 0)
    house = rooms.house([floor], [Material("floor", diffuse=(1, 1, 1), texture_id="t")])
    camera, geometry = rooms.camera((0, 1, 3), (0, 0, 0)), geometry_from_house(house)
    hit = Caster(geometry).hit_record(camera)
    worst = 0.0
    for texel in (60, 120, 180, 225, 255):
        pictures = {"t": np.full((2, 2, 3), texel, np.uint8)}
        scene = LightScene.load(house, pictures, recipe, uniform_sky((1, 1, 1)))
        fields = recipe.light.model_copy(update={"spp": 256})
        lit = scene.render(camera, "0_0", fields, 1).outdoor[14:].mean((0, 1))
        label = albedo_label(hit, house, geometry, pictures, max_albedo(recipe))[14:].mean((0, 1))
        worst = max(worst, float(np.abs(srgb_from_linear(lit) * 255 - label).max()))
    return worst


def _emitter_error() -> float:
    """Largest relative error of the radiance of two glTF panels."""
    in_file = {"Panel": ((1.0, 1.0, 1.0), 1000.0), "Red panel": ((1.0, 0.0, 0.0), 500.0)}
    scene = two_rooms()
    for k, (name, (rgb, strength)) in enumerate(in_file.items()):
        extension = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
        scene.materials.append(
            {
                "name": name,
                "emissiveFactor": list(rgb),
                "extensions": extension,
                "doubleSided": True,
            }
        )
        x = 1.0 + k
        corners = [[x, 1, 1], [x + 0.5, 1, 1], [x + 0.5, 1.5, 1], [x, 1.5, 1]]
        scene.node(name, mesh=scene.mesh([corners], len(scene.materials) - 1))
    recipe = recipe_from_name("fast")
    house, _report = repair(read(scene), recipe.repair)
    geometry = geometry_from_house(house)
    keep = np.ones(len(geometry.faces), bool)
    radiance = {
        house.items[e.item].name: np.array(e.radiance) * LM_PER_W
        for e in area_emitters_of_house(house, geometry, keep, recipe)
    }
    return max(
        float(np.abs(radiance[name] - np.array(rgb) * strength).max()) / strength
        for name, (rgb, strength) in in_file.items()
    )


def _is_union(root: Path) -> bool:
    sizes = {"image.width_px": "64", "image.height_px": "48", "cameras.cell_m": "1.0"}
    recipe = recipe_from_name("preview", sizes)
    first = ("material", "class_source", "depth_z")
    for mode, layers in (
        ("opengl_dl", first), ("opengl_dl", ()), ("opengl_il", ("albedo",)), ("opengl_dl", first[::-1])
    ):  # fmt: skip
        run = Run(["builtin"], str(root), recipe, wanted([mode], layers, 1))
        if run_local(run).failures or run_local(run).n_done or not verify(root).is_clean:
            return False
    (view,) = root.glob("houses/*/views/*")
    expected_files = {"material.png", "class_source.png", "depth_z.exr", "albedo.png"}
    tables = json.loads((view / "view.json").read_text())
    return all((view / f).is_file() for f in expected_files) and {
        "materials",
        "source_classes",
    } <= set(tables)


def _verify_cpu_s(root: Path) -> float:
    """CPU seconds of `verify` for a view, its kernels compiled before."""
    sizes = {"image.width_px": "640", "image.height_px": "480"}
    run = Run(["Studio"], str(root), recipe_from_name("preview", sizes), wanted([], [], 2))
    if run_local(run).failures or not verify(root).is_clean:
        raise RuntimeError(f"{root}: not CLEAN, so its cost is not measured")
    began = os.times()
    certificate = verify(root)
    ended = os.times()
    return sum(b - a for a, b in zip(began[:4], ended[:4], strict=True)) / certificate.n_views


def _box_errors() -> tuple[float, int]:
    recipe = recipe_from_name("fast")
    homes = [home.name for home in homes_package.example_homes()][:N_DRAWN]
    worst, n = 0.0, 0
    for name in (*homes, *MADE):
        seeds = (1,) if name in homes else (0,)
        (source,) = variants(resolve(name), seeds)
        house, _report = repaired_house(source, recipe)
        errors = _errors_mm(house)
        print(
            f"{name:<36} {len(errors):>5} boxes, worst {max(errors, default=0):.4f} mm", flush=True
        )
        worst, n = max([worst, *errors]), n + len(errors)
    return worst, n


def _errors_mm(house: House) -> list[float]:
    """Largest distance in mm between the sides of each item's box and its triangles."""
    errors = []
    for item in house.items:
        points = corners_of_surfaces(item.surfaces).reshape(-1, 3)
        if len(points):
            local = (points - item.oriented_box.centre) @ item.oriented_box.axes
            sides = np.array([-local.min(0), local.max(0)]) - item.oriented_box.half
            errors.append(1000 * float(np.abs(sides).max()))
    return errors


if __name__ == "__main__":
    main()
