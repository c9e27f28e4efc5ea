"""Small output roots of every sort: films, pairs, lamps, edited, generated, read from eight formats, own cameras.

Effects: renders into folders. None needs a download.
"""

from __future__ import annotations

import itertools
import json
import tempfile
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any
from unittest import mock

import pbrs_farm as pf
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.prepare.home_kinds import object_source
from pbrs_farm.read.objects.model_folders import find_models
from pbrs_farm.run import local
from pbrs_farm.run.local_run import Run
from pbrs_farm.run.plan import wanted
from tests.check.roots import all_layers
from tests.inputs.sound_files import every_format
from tests.read.gltf.gltf_scenes import two_rooms
from tests.scene.homes import can, crate, small_home

_SMALL = {
    "image.width_px": "160", "image.height_px": "120", "light.spp": "4", "light.pilot_spp": "0",
    "light.denoise": "false", "cameras.cell_m": "1.0",
    "cameras.score_width_px": "160", "cameras.score_height_px": "120",
}  # fmt: skip
_WALK = {"cameras.source": "walk", "cameras.walk_frames": "4", "cameras.walk_fps": "12"}
_SURFACES = ("albedo", "normal_shading", "material")
_READ = (
    "OBJ",
    "URDF and SDF",
    "glTF",
    "OpenUSD",
    "IFC",
    "SUNCG",
    "Sweet Home 3D",
    "ProcTHOR and Holodeck",
)

Make = Callable[[Path], None]


def rendered(
    word: str, words: Mapping[str, str] | None = None, *, n_views: int = 1,
    layers: tuple[str, ...] | None = None, pairs: bool = False,
) -> Make:  # fmt: skip
    """Render a root of one home in all modes, with every possible layer."""

    def make(root: Path) -> None:
        recipe = recipe_from_name("preview", _SMALL | dict(words or {}))
        names = all_layers() if layers is None else layers
        run = Run([word], str(root), recipe, wanted((), names, n_views, pairs=pairs))
        # One process loads the renderer, not two.
        with mock.patch.object(local, "finishes_apart", return_value=False):
            failures = local.run_local(run).failures
        if failures:
            raise RuntimeError(f"{word}: {failures}")

    return make


def _edited(root: Path) -> None:
    """Items placed, moved and painted, with poses and model coordinates."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        home = small_home().set(**{"light.spp": 4, "light.denoise": False})
        home = home.place(can(folder), at=(2, 0.5, 2)).place(crate(folder), at=(2.1, 0.5, 1.9))
        home = home.place(can(folder), at=(1.6, 0.5, 2.1))
        look = pf.Camera.look_at((1.9, 0.9, 2.9), (2, 0.56, 2), size=(160, 120), hfov_deg=50)
        layers = [n for n in all_layers() if not n.startswith(("flow", "occlusion_", "disparity"))]
        pf.render(home, look, layers=layers).save(root)


def sunlit(azimuth_deg: float) -> Make:
    """A floor on which the sun shines through a window at 345 degrees."""

    def make(root: Path) -> None:
        settings = {"light.spp": 16, "light.pilot_spp": 0, "light.denoise": False}
        home = small_home().sun(elevation=30.0, azimuth=azimuth_deg).set(**settings)
        eye, target = (1.90, 1.35, 3.21), (2.39, 0.91, 2.46)
        look = pf.Camera.look_at(eye, target, size=(160, 120), hfov_deg=55.4)
        pf.render(home, look).save(root)

    return make


def _opened(root: Path) -> None:
    """The door between the rooms ajar, with the parts that open."""
    home = small_home().open("door_inner", 0.6)
    door = home.items["door_inner"]
    x, y, z = door.bounds.mean(0)
    look = pf.Camera.look_at((x - 1.6, y + 0.3, z - 0.9), (x, y, z), size=(160, 120), hfov_deg=70)
    pf.render(home, look, modes=["opengl_dl"], layers=["part"]).save(root)


def pictured(
    home: Callable[[Path], pf.Home],
    *looks: pf.Camera,
    layers: tuple[str, ...] = _SURFACES,
    **words: Any,
) -> Make:
    """Pictures of a home by own cameras, or by the view that it chooses; home: gets an empty folder."""

    def make(root: Path) -> None:
        with tempfile.TemporaryDirectory() as name:
            settings = {k.replace("__", "."): v for k, v in words.items()}
            chosen = home(Path(name)).set(**_SMALL | settings)
            # A camera in no room is a warning.
            with warnings.catch_warnings(action="ignore", category=UserWarning):
                pf.render(chosen, looks or chosen.cameras(n=1), layers=layers).save(root)

    return make


def _look(eye: Sequence[float], target: Sequence[float]) -> pf.Camera:
    return pf.Camera.look_at(eye, target, size=(160, 120), hfov_deg=70)


def _small_home(_folder: Path) -> pf.Home:
    return small_home()


def _lamps_set(_folder: Path) -> pf.Home:
    return small_home().light("floor lamp", lm=900, kelvin=2700).open("door_inner", 0.5)


def _bright_lamp(_folder: Path) -> pf.Home:
    """A floor lamp brighter than the room's other lamp, so that exchanged layers of the two differ."""
    return small_home().light("floor lamp", lm=6000)


def _read(title: str) -> Callable[[Path], pf.Home]:
    return lambda folder: pf.load(every_format()[title](folder), recipe="preview")


def _room_round_walls(folder: Path) -> pf.Home:
    """A room whose only lamp is between inner walls, which shade most of its floor."""
    corners = [(6, 4.2), (6, 6), (3, 6), (3, 3), (6, 3)]
    walls = [{"start": a, "end": b, "thickness": 0.1} for a, b in itertools.pairwise(corners)]
    plan = {
        "height": 2.5, "walls": walls,
        "rooms": [{"type": "living", "polygon": [(0, 0), (9, 0), (9, 9), (0, 9)]}],
        "doors": [{"at": (9, 1), "entrance": True}],
    }  # fmt: skip
    (folder / "plan.json").write_text(json.dumps(plan))
    return pf.load(folder / "plan.json", recipe="preview")


def _french_window(folder: Path) -> pf.Home:
    """A room with a glazed door."""
    plan = {
        "height": 2.5,
        "rooms": [{"type": "living", "polygon": [(0, 0), (4, 0), (4, 4), (0, 4)]}],
        "doors": [{"at": (4, 1), "entrance": True}],
        "windows": [{"at": (2, 0), "width": 1.0, "height": 2.1, "sill": 0.0}],
    }  # fmt: skip
    (folder / "plan.json").write_text(json.dumps(plan))
    return pf.load(folder / "plan.json", recipe="preview")


def _cabinets(folder: Path) -> pf.Home:
    """Two cabinets whose fronts coincide over 20 cm, one of them with a worktop of its height."""
    scene = two_rooms()
    scene.node("Cabinet.001", mesh=scene.box([1.0, 0, 0.01], [1.6, 0.9, 0.6]))
    scene.node("Cabinet.002", mesh=scene.box([1.4, 0, 0.01], [2.0, 0.9, 0.6]))
    scene.node("Worktop", mesh=scene.box([1.0, 0.86, 0.01], [1.6, 0.9, 0.6]))
    (folder / "home.glb").write_bytes(scene.glb())
    return pf.load(folder / "home.glb", recipe="preview")


def _doors_that_open(root: Path) -> None:
    """A walk while doors open."""
    home = small_home().set(**_SMALL | _WALK).open("door_*", at={0: 0.1, 0.25: 1})
    pf.render_homes(home, root, layers=("flow_forward", "part"), tracks=True)


def _model_alone(root: Path) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        crate(folder)
        word = object_source(find_models([folder])[0]).location
        rendered(word, layers=_SURFACES)(root)


ROOTS: dict[str, Make] = {
    "finished": rendered("builtin", n_views=2, pairs=True),
    "film": rendered("builtin", _WALK | {"blur.shutter_s": "0.01", "blur.rolling_s": "0.02"}, n_views=0),
    "pair": rendered("builtin", {"cameras.stereo_m": "0.065"}, n_views=2),
    "lamps": rendered("builtin", {"light.groups": "lamps", "light.spp": "16"}, layers=("residual_indoor",)),
    "cameras": rendered("builtin", {"light.denoise": "true", "light.spp": "16", "tone.variants": "3"}, layers=("residual",)),
    "lit floor": pictured(_bright_lamp, _look((3.4, 1.6, 1.6), (1.0, 0.3, 0.9)), layers=(), light__groups="lamps", light__spp=16),
    "sun": sunlit(345.0),
    "sensor": rendered("builtin", {"light.denoise": "true", "tone.camera": "drawn", "tone.variants": "2"}, layers=()),
    "dark": rendered("builtin", {"light.denoise": "true", "light.spp": "8", "sky.time": "night", "tone.camera": "webcam",
                                 "tone.variants": "1", "image.width_px": "216", "image.height_px": "162"}, n_views=2, layers=()),
    "lens": rendered("builtin", {"lens.preset": "d455", "image.width_px": "212", "lens.cx": "380", "lens.fy": "460",
                               "materials.preset": "released"}, layers=()),
    "a lens of fourteen numbers": rendered("builtin", {f"lens.{k}": v for k, v in {
        "model": "opencv", "fx": "400", "k1": "-0.28", "k2": "0.07", "p1": "0.001", "k4": "0.02", "s1": "0.004", "s4": "0.001", "tau_x": "0.03", "tau_y": "-0.05",
    }.items()}, layers=("albedo", "depth_layers", "depth_hole")),
    "edited": _edited,
    "opened": _opened,
    "generated": rendered("made:3", layers=("albedo", "normal_shading")),
    "generated, with a balcony, mirrors and sun": rendered("made:11", {"light.denoise": "true", "light.spp": "16"}, n_views=4, layers=("albedo",)),
    "generated, with a lamp of rods": rendered("made:22", {"cameras.cell_m": "0.25", "cameras.score_width_px": "80", "cameras.score_height_px": "60"}, n_views=4, layers=()),
    **{f"read from {title}": pictured(_read(title)) for title in _READ},
    "seen from outside": pictured(_small_home, _look((-4, 2, -3), (2, 1, 2)), _look((2, 7, 2), (2, 0, 2.1))),
    "a room round inner walls": pictured(_room_round_walls, _look((0.7, 1.6, 0.7), (3, 0, 8))),
    "a French window": pictured(_french_window, _look((2.6, 1.5, 3.6), (2, 1, 0))),
    "coincident cabinets": pictured(_cabinets, _look((1.6, 1.4, 2.6), (1.5, 0.5, 0))),
    "a fisheye at night": pictured(_small_home, lens__model="fisheye", lens__hfov_deg=180, sky__time="night"),
    "a sphere": pictured(_small_home, lens__model="equirect", image__width_px=160, image__height_px=80),
    "lamps set and a door open": pictured(_lamps_set),
    "doors that open": _doors_that_open,
    "a model alone": _model_alone,
}  # fmt: skip
