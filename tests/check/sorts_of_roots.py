"""Small output roots of every sort: films, pairs, lamps, edited, generated, read from six formats.

Effects: renders into folders. None needs a download.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

import pbrs_farm as pf
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.run.local import run_local
from pbrs_farm.run.local_run import Run
from pbrs_farm.run.plan import wanted
from tests.check.roots import all_layers
from tests.inputs.sound_files import every_format
from tests.scene.homes import can, crate, small_home

_SMALL = {
    "image.width_px": "160", "image.height_px": "120", "light.spp": "4", "light.pilot_spp": "0",
    "light.denoise": "false", "cameras.cell_m": "1.0",
    "cameras.score_width_px": "160", "cameras.score_height_px": "120",
}  # fmt: skip
_WALK = {"cameras.source": "walk", "cameras.walk_frames": "4", "cameras.walk_fps": "12"}
_READ = ("glTF", "OpenUSD", "IFC", "SUNCG", "Sweet Home 3D", "ProcTHOR and Holodeck")

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
        failures = run_local(run).failures
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


def _read(title: str) -> Make:
    def make(root: Path) -> None:
        with tempfile.TemporaryDirectory() as name:
            path = every_format()[title](Path(name))
            rendered(str(path), layers=("albedo", "normal_shading", "material"))(root)

    return make


ROOTS: dict[str, Make] = {
    "finished": rendered("builtin", n_views=2, pairs=True),
    "film": rendered("builtin", _WALK | {"blur.shutter_s": "0.01", "blur.rolling_s": "0.02"}, n_views=0),
    "pair": rendered("builtin", {"cameras.stereo_m": "0.065"}, n_views=2),
    "lamps": rendered("builtin", {"light.groups": "lamps", "light.spp": "16"}, layers=("residual_indoor",)),
    "cameras": rendered("builtin", {"light.denoise": "true", "light.spp": "16", "tone.variants": "3"}, layers=("residual",)),
    "sun": sunlit(345.0),
    "sensor": rendered("builtin", {"light.denoise": "true", "tone.camera": "drawn", "tone.variants": "2"}, layers=()),
    "dark": rendered("builtin", {"light.denoise": "true", "light.spp": "8", "sky.time": "night", "tone.camera": "webcam",
                                 "tone.variants": "1", "image.width_px": "216", "image.height_px": "162"}, n_views=2, layers=()),
    "lens": rendered("builtin", {"lens.preset": "d455", "image.width_px": "212", "lens.cx": "380", "lens.fy": "460",
                               "materials.preset": "released"}, layers=()),
    "edited": _edited,
    "opened": _opened,
    "generated": rendered("made:3", layers=("albedo", "normal_shading")),
    "generated, with a balcony, mirrors and sun": rendered("made:11", {"light.denoise": "true", "light.spp": "16"}, n_views=4, layers=("albedo",)),
    "generated, with a lamp of rods": rendered("made:22", {"cameras.cell_m": "0.25", "cameras.score_width_px": "80", "cameras.score_height_px": "60"}, n_views=4, layers=()),
    **{f"read from {title}": _read(title) for title in _READ},
}  # fmt: skip
