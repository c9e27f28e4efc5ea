"""The step develop: stored radiance to the pictures of the light modes. Effects: reads the store."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import Srgb8Image
from pbrs_farm.core.camera import View
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.frames import linear_from_srgb
from pbrs_farm.core.house import Note
from pbrs_farm.core.layers import LAYER
from pbrs_farm.core.lighting import Group, Mode
from pbrs_farm.core.picture_cameras import PictureCamera
from pbrs_farm.core.plugins import plugin
from pbrs_farm.core.recipe import HistogramFields, ToneFields
from pbrs_farm.formats.layer_file import layer_bytes, layer_from_bytes
from pbrs_farm.formats.radiance_exr import FILE as RADIANCE_EXR
from pbrs_farm.formats.radiance_exr import RadianceExr, radiance_from_exr
from pbrs_farm.run.house_cache import CachedHouse
from pbrs_farm.run.output_root import attribution
from pbrs_farm.run.relight import linear_aovs
from pbrs_farm.run.step_cache import StepOutput, Work
from pbrs_farm.run.view_setup import ViewSetup
from pbrs_farm.selection import scene_quality, view_record
from pbrs_farm.selection.quality import ViewPlace
from pbrs_farm.store.object_store import Store
from pbrs_farm.transport.develop.camera_sensor import SensorShot
from pbrs_farm.transport.develop.mode_pictures import (
    LinearAovs,
    ToneMappedImage,
    denoise_aovs,
    develop,
    wanted_exposures,
)
from pbrs_farm.transport.diffuse_images import (
    ALBEDO,
    IMAGE_OF_GROUP,
    intrinsic_parts,
    shading_by_group,
)

_GROUPS_OF_ENDING: Final = {
    "": (Group.OUTDOOR, Group.INDOOR),
    "_outdoor": (Group.OUTDOOR,),
    "_indoor": (Group.INDOOR,),
}

_LAGS: Final = 4.0  # of what came earlier than so many lags less than 2 % is left
_GLANCE_PX: Final = (32, 24)  # of the small pictures that tell how bright earlier frames are
_GLANCE_SPP: Final = 16


def develop_step(work: Work, setup: Callable[[], ViewSetup]) -> StepOutput:
    """The PNGs of the light modes: groups summed, denoised, white-balanced, tone-mapped.

    The recipe's camera develops the view, and a drawn one each variant. setup: loads the view and its
    house; called only where earlier frames change the exposure.
    """
    key = keys.view_key(work.house_id, work.view_id or "", RADIANCE_EXR)
    radiance = radiance_from_exr(work.store.get(key), key)
    raw = aovs = linear_aovs(radiance)
    # Denoise once for the modes, the variants, the plugins' pictures and the intrinsic layers.
    if work.recipe.light.denoise:
        aovs = denoise_aovs(aovs, wraps=_wraps(work))
    camera = work.recipe.camera_of(work.house_id, work.view_id or "")
    images = _taken(work, aovs, camera, 0, setup)
    # Write a PNG a mode; its exposure and white balance become facts.
    credit = attribution(work.store, work.house_id)
    files = {LAYER[m].file: layer_bytes(m, i.rgb_srgb8, credit) for m, i in images.items()}
    for name in filter(None, camera.tone.pictures.split(":")):
        picture = _picture_of_plugin(name, aovs, camera.tone)
        files[LAYER[name].file] = layer_bytes(name, picture, credit)
    facts: dict[str, Any] = {"denoised": work.recipe.light.denoise}
    facts |= {m: i.facts() for m, i in images.items()} | camera.facts()
    variants = []
    for n in range(1, camera.tone.variants + 1):
        drawn = work.recipe.camera_of(work.house_id, work.view_id or "", n)
        image = _taken(work, aovs, drawn, n, setup)[Mode.MLT_IL_OL]
        name = f"mlt_il_ol.{n}"
        file = LAYER[name].file
        files[file] = layer_bytes(name, image.rgb_srgb8, credit)
        variants.append({"file": file, "camera": drawn.name} | drawn.facts() | image.facts())
    if variants:
        facts["variants"] = variants
    if layers := work.layers_of("develop"):
        arrays = _intrinsic_layers(work, layers, radiance, raw, aovs)
        files |= {LAYER[n].file: layer_bytes(n, a, credit) for n, a in arrays.items()}
        facts["layers"] = layers
    return StepOutput(files, facts)


def _intrinsic_layers(
    work: Work, names: Sequence[str], radiance: RadianceExr, raw: LinearAovs, light: LinearAovs
) -> dict[str, NDArray[np.float16]]:
    """The named layers of shading and residual; light: raw, or denoised as the recipe says."""
    images = (ALBEDO, *IMAGE_OF_GROUP.values())
    diffuse = {name: radiance.image(name) for name in images}
    denoise = work.recipe.light.denoise
    shading = shading_by_group(raw, diffuse, denoise=denoise, wraps=_wraps(work))
    key = keys.view_key(work.house_id, work.view_id or "", LAYER["albedo"].file)
    layers: dict[str, NDArray[np.float16]] = {}
    for ending, groups in _GROUPS_OF_ENDING.items():
        asked_names = [name for name in (f"shading{ending}", f"residual{ending}") if name in names]
        if not asked_names:
            continue
        total = sum((getattr(light, g.value) for g in groups), np.zeros_like(raw.outdoor))
        lit = sum((shading[g] for g in groups), np.zeros_like(raw.outdoor))
        albedo = np.zeros_like(lit)
        if f"residual{ending}" in asked_names:
            label = layer_from_bytes("albedo", work.store.get(key), key)
            albedo = linear_from_srgb(label / 255).astype(np.float32)
        parts = intrinsic_parts(total, albedo, lit)
        layers |= {name: parts[name.startswith("residual")] for name in asked_names}
    return layers


def _taken(
    work: Work,
    aovs: LinearAovs,
    camera: PictureCamera,
    variant: int,
    setup: Callable[[], ViewSetup],
) -> dict[str, ToneMappedImage]:
    """Mode -> the picture of denoised light that a camera takes."""
    shot = _sensor_shot(work, camera, variant, setup)
    return develop(aovs, camera.tone, denoise=False, shot=shot, wraps=_wraps(work))


def _picture_of_plugin(name: str, light: LinearAovs, tone: ToneFields) -> Srgb8Image:
    """(H, W, 3) uint8 of a plugin's function; BadInput where it gives anything else."""
    picture = np.asarray(plugin("pictures", name).load()(light, tone))
    if picture.dtype != np.uint8 or picture.shape != light.outdoor.shape:
        got = f"gave {picture.dtype} of shape {picture.shape}"
        raise BadInput(f"picture {name}", "", f"{got}, expected uint8 of {light.outdoor.shape}")
    return picture


def _wraps(work: Work) -> bool:
    # Whether the left edge of its pictures adjoins the right one.
    return work.recipe.lens.model == "equirect"


def _sensor_shot(
    work: Work, camera: PictureCamera, variant: int, setup: Callable[[], ViewSetup]
) -> SensorShot | None:
    fields, tone = camera.sensor, camera.tone
    if not fields.is_on:
        return None
    parts: list[str | int] = [
        "sensor",
        work.recipe.digest("sensor"),
        *([variant] if variant else []),
    ]
    seed = work.recipe.shot(work.view_id or "").seed(work.house_id, *parts, per="view")
    if fields.lag_s == 0:
        return SensorShot(fields, seed)
    now = setup()
    earlier = now.earlier_frames(_LAGS * fields.lag_s)
    denoise = work.recipe.light.denoise
    exposures = tuple(
        wanted_exposures(glance(work, now.house, view), tone, denoise=denoise, wraps=_wraps(work))
        for _time_s, view in earlier
    )
    return SensorShot(fields, seed, exposures, tuple(time_s for time_s, _view in earlier))


def glance(work: Work, house: CachedHouse, view: View) -> LinearAovs:
    """A small picture of a frame, the same whether its own light is rendered yet or not."""
    fields = work.recipe.light.model_copy(
        update={
            "integrator": "path",
            "spp": _GLANCE_SPP,
            "noise": 0.0,
            "time_budget_s": 0.0,
            "groups": "two",
        }
    )
    seed = view.shot.seed(work.house_id, "glance", work.recipe.seed, per="view")
    camera = view.camera.with_size(*_GLANCE_PX)
    light = house.light_scene.render(camera, view.room_id, fields, seed)
    return LinearAovs(light.outdoor, light.indoor, light.albedo, light.normal)


_MISSING_TEXTURE: Final = frozenset({"missing-texture", "unreadable-texture"})


def view_histogram(
    store: Store,
    place: ViewPlace,
    modes: Iterable[Mode],
    view_json: Mapping[str, Any],
    notes: Iterable[Note],
    settings: HistogramFields,
) -> bytes:
    """Bytes of histogram.json of one view (formats.histogram_json.ViewRecord).

    place: "house", "view", "room" and "room_type" (the room's name). modes: those rendered.
    view_json: its "instances" and, where light was
    traced, "noise" of the sum of both groups anywhere below "modes". notes: of the house.
    Raises BadInput when a picture cannot be read.
    """

    def picture(layer: str) -> Any:
        key = keys.view_key(place["house"], place["view"], LAYER[layer].file)
        return layer_from_bytes(layer, store.get(key), key)

    depth = picture("depth")
    if depth.ndim != 2 or depth.dtype != np.uint16:
        raise BadInput(keys.view_key(place["house"], place["view"], "depth.png"), "", "no depth")
    # Measure what depth and labels tell of the view.
    scene = scene_quality(
        depth,
        view_json.get("instances", ()),
        settings,
        noise=_noise(view_json),
        missing_textures=sum(note.kind in _MISSING_TEXTURE for note in notes),
    )
    pictures = {mode: picture(mode.value) for mode in sorted(set(modes))}
    return view_record(place, pictures, depth, scene, settings).json_bytes()


def _noise(view_json: Mapping[str, Any]) -> float | None:
    light = (view_json.get("modes") or {}).get("light") or {}
    # Path tracing has a number per light group and of their sum.
    noise = light.get("noise")
    if isinstance(noise, Mapping):
        noise = noise.get("sum")
    return float(noise) if isinstance(noise, int | float) else None
