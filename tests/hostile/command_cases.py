"""Camera files, recipes and arguments that request the impossible. Effects: they write files."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, Final

from tests.hostile.case import TINY, Case, Place, Words, run

_LINE: Final = "2 1.5 1.5  1 0 0  0 1 0  0.5 0.4 1.0\n"
_CAMERA: Final = {"eye": [2, 1.5, 1.5], "towards": [1, 0, 0]}

_SETTINGS: Final = (
    "light.spp=1e12", "light.spp=1000000000000", "light.spp=NaN", "light.max_depth=1000000000",
    "light.pilot_spp=1000000000", "light.max_spp=1000000000000", "light.noise=1e-12",
    "light.direct_spp=1000000000000", "light.mutations_per_pixel=1000000000000",
    "light.chains=1000000000", "light.tail_pixels=1000000000", "light.time_budget_s=1e12",
    "image.width_px=1e12", "image.width_px=16384", "cameras.cell_m=0.02", "cameras.cell_m=1e-9",
    "cameras.n_sectors=1000000000", "cameras.per_sector=1000000000", "cameras.height_min_m=1e30",
    "cameras.score_width_px=1000000", "cameras.coarse_width_px=100000", "cameras.tilt_deg=1e30",
    "cameras.clearance_m=1e30", "cameras.file=/dev/zero", "raster.samples=1000000000",
    "raster.lights_per_object=1000000000", "emission.lamp_lm=1e300", "emission.sky_lx=1e300",
    "tone.key=1e300", "tone.key=nan", "read.max_triangles=1", "read.max_extent_m=1e300",
    "repair.wall_thickness_m=1e9", "repair.bulb_radius_m=1e-30", "repair.default_wall_rgb=[9,9]",
    "histogram.depth_max_m=1e-30", "nobody.field=1", "light.nobody=1", "light=1", "=", "a=b=c",
    "seed=-1", "seed=99999999999999999999999", "light.spp=[[[[", "sky.panoramas=/dev/zero",
)  # fmt: skip


def cases() -> Iterator[Case]:
    """Camera files as text and as JSON; settings; other arguments."""
    for name, text in _camera_files().items():
        fault = "bounds" if "million" in name else "format"
        yield Case(f"cameras/{name}", fault, partial(_cameras, text), neighbours=0)
    for setting in _SETTINGS:
        yield Case(f"set/{setting[:40]}", "bounds", partial(_setting, setting), neighbours=0)
    for name, words in _words().items():
        yield Case(f"words/{name}", "format", partial(_more, words), neighbours=0)
    yield Case("words/recipe_empty", "format", partial(_recipe, b""), neighbours=0)
    yield Case("words/recipe_noise", "format", partial(_recipe, bytes(range(256))), neighbours=0)
    yield Case("words/out_is_a_file", "format", _out_is_a_file, neighbours=0)
    yield Case("words/map_without_suffix", "format", _map, neighbours=0)


def _camera_files() -> dict[str, Callable[[], str | bytes]]:
    def one(**more: Any) -> Callable[[], str]:
        return lambda: json.dumps([_CAMERA | more])

    return {
        "empty": lambda: "",
        "list_empty": lambda: "[]",
        "noise": lambda: bytes(range(256)) * 9,
        "cut": lambda: "[{",
        "deep": lambda: "[" * 200_000,
        "object": lambda: json.dumps(_CAMERA),
        "nan": one(eye=[float("nan"), 0, 0]),
        "huge": one(eye=[1e308, 1e308, 1e308]),
        "far": one(eye=[1e6, 1.5, 1.5]),
        "in_wall": one(eye=[0.0, 1.5, 1.5]),
        "towards_zero": one(towards=[0, 0, 0]),
        "towards_up": one(towards=[0, 1, 0]),
        "towards_tiny": one(towards=[1e-300, 0, 0]),
        "fov_0": one(hfov_rad=0),
        "fov_wide": one(hfov_rad=3.0999),
        "pose_and_eye": one(world_from_camera=[[1, 0, 0, 0]] * 4),
        "extra": one(nobody=1),
        "json_million": lambda: "[" + ",".join([json.dumps(_CAMERA)] * 1_000_000) + "]",
        "text_million": lambda: _LINE * 1_000_000,
        "text_short": lambda: "1 2 3\n",
        "text_words": lambda: "a b c d e f g h i j k l\n",
        "text_nan": lambda: _LINE.replace("0.5", "nan"),
        "text_half_angle": lambda: _LINE.replace("0.5", "99"),
        "text_line_100_mb": lambda: "1 " * 50_000_000,
    }


def _cameras(text: Callable[[], str | bytes], place: Place) -> list[Words]:
    data = text()
    path = place.folder / "given.json"
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return [_sound(place, "--camera-file", str(path))]


def _sound(place: Place, *more: str) -> Words:
    """`run SOUND` with more arguments."""
    words = list(run(place, place.sound, *more))
    return [words[0], *words[2:]]


def _setting(setting: str, place: Place) -> list[Words]:
    words = list(_sound(place, "--set", setting))
    if setting.startswith(("light.", "emission.", "tone.", "sky.", "image.width_px=16384")):
        words[words.index("opengl_dl")] = "mlt_il_ol"  # the mode that has these fields
        words += ["--set", "light.spp=1"] if "spp" not in setting else []
    if setting.startswith(("light.chains", "light.mut", "light.direct", "light.tail")):
        words += ["--set", "light.integrator=metropolis"]
    if setting.startswith(("light.noise", "light.max_spp", "light.time")):
        words += ["--step-timeout", "3600"]
    return [words]


def _words() -> dict[str, list[str]]:
    return {
        "views_minus": ["--views", "-1"],
        "views_huge": ["--views", "1000000000000"],
        "jobs_100_000": ["--jobs", "100000"],
        "jobs_word": ["--jobs", "many"],
        "size_0": ["--size", "0x0"],
        "size_minus": ["--size", "-1x5"],
        "size_words": ["--size", "axb"],
        "size_huge": ["--size", "999999x999999"],
        "noise_minus": ["--noise", "-1"],
        "noise_word": ["--noise", "loud"],
        "time_budget_nan": ["--time-budget", "nan"],
        "step_timeout_0": ["--step-timeout", "0"],
        "step_timeout_nan": ["--step-timeout", "nan"],
        "mode_unknown": ["--modes", "crayon"],
        "layer_unknown": ["--layers", "icing"],
        "recipe_unknown": ["--recipe", "soup"],
        "recipe_path": ["--recipe", "../../../etc/passwd"],
        "recipe_zero": ["--recipe", "/dev/zero"],
    }


def _more(more: list[str], place: Place) -> list[Words]:
    return [_sound(place, *more)]


def _recipe(data: bytes, place: Place) -> list[Words]:
    path = place.folder / "recipe.json"
    path.write_bytes(data)
    return [_sound(place, "--recipe", str(path))]


def _out_is_a_file(place: Place) -> list[Words]:
    place.out.write_bytes(b"")
    return [_sound(place)]


def _map(place: Place) -> list[Words]:
    out = place.folder / "map_rel"
    return [("cameras", str(place.sound), "--map", str(out), *TINY)]
