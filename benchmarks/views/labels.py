"""Labels: seconds a view, all layers included, and what the independent caster says of them."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.figures import write_report
from benchmarks.views.gl import turned_cameras
from pbrs_farm import truth
from pbrs_farm.check import Certificate, verify
from pbrs_farm.check.certificate import Count
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.house import House, geometry_from_house
from pbrs_farm.core.layers import LAYER
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.formats.layer_file import layer_bytes
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.repair import repair
from pbrs_farm.run.house_cache import decoded_textures
from tests.check.roots import make_root

HOME = "Studio"
N_VERIFIED = 100
N_ALL_PIXELS = 6


def main() -> None:
    """Measure, print and write out/bench/labels.json."""
    recipe = Recipe()
    house, _report = repair(read_house(resolve(HOME), recipe.read), recipe.repair)
    cameras = turned_cameras(house, n_turns=-(-N_VERIFIED // len(house.cameras)))[:N_VERIFIED]
    basic_s, all_s = _seconds_a_view(house, cameras[::10])
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder) / "hundred"
        make_root(root, house, {f"v{k:03d}": camera for k, camera in enumerate(cameras)})
        started = time.perf_counter()
        sampled = verify(root)
        verify_s = time.perf_counter() - started
        few = Path(folder) / "few"
        make_root(
            few,
            house,
            {f"v{k}": c for k, c in enumerate(cameras[:: -(-len(cameras) // N_ALL_PIXELS)])},
        )
        whole = verify(few, all_pixels=True)
    for certificate in (sampled, whole):
        print(certificate.text(), end="\n\n")
    _write(basic_s, all_s, verify_s, sampled, whole)


def _write(
    basic_s: float, all_s: float, verify_s: float, sampled: Certificate, whole: Certificate
) -> None:
    none = Count()
    instance, normal = (whole.counts.get(f"ray: {x}", none) for x in ("instance", "normal"))
    figures: dict[str, Any] = {
        "labels.view_s": round(basic_s, 3),
        "labels.all_layers_s": round(all_s, 3),
        "verify.100_views_s": round(verify_s, 1),
        "labels.pixels_checked": instance.checked,
        "labels.normals_off": normal.failed,
        "labels.instances_differ": (instance.failed + instance.ties) / max(instance.checked, 1),
        "labels.checks_failed": sum(c.failed for x in (sampled, whole) for c in x.counts.values()),
    }
    units = dict.fromkeys(figures, "pixels") | {
        "labels.view_s": "s",
        "labels.all_layers_s": "s",
        "verify.100_views_s": "s",
        "labels.instances_differ": "share of pixels",
        "labels.checks_failed": "checks",
    }
    write_report("labels", figures, units)


def _seconds_a_view(house: House, cameras: list[Camera]) -> tuple[float, float]:
    """Median seconds from camera to encoded files: the labels every view has; those and all more."""
    geometry = geometry_from_house(house)
    caster, textures = Caster.of_house(house, geometry), decoded_textures(house)[0]
    basic, everything = [], []
    for camera in [cameras[0], *cameras]:  # the first warms the caster's kernels up
        started = time.perf_counter()
        hit = caster.hit_record(camera)
        arrays = truth.layers_from_hit(hit, house, camera)
        truth.view_table(hit.item, house, camera, cut_outs=caster.cut_outs)
        for name, array in arrays.items():
            layer_bytes(name, array)
        basic.append(time.perf_counter() - started)
        label_inputs = truth.LabelInputs(
            hit,
            house,
            geometry,
            camera,
            lambda skip, camera=camera: caster.hit_record(camera, skip_faces=skip),  # type: ignore[misc]
            textures,
        )
        for name, array in truth.optional_layers(truth.OPTIONAL_NAMES, label_inputs).items():
            layer_bytes(name, array)
        everything.append(time.perf_counter() - started)
    assert set(arrays) | set(truth.OPTIONAL_NAMES) <= set(LAYER)
    return float(np.median(basic[1:])), float(np.median(everything[1:]))


if __name__ == "__main__":
    main()
