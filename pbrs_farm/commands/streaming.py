"""A set's file as a stream for training (`pf.stream`). Effects: reads the file, starts the renderer."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any, Final

import pbrs_farm
from pbrs_farm.commands.set_file import set_from_word
from pbrs_farm.core import keys
from pbrs_farm.core.checked_calls import Count, Positive, Size, Whole, as_words, checked_call
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.layers import LAYER, OPTIONAL
from pbrs_farm.core.recipe import with_settings
from pbrs_farm.core.shown_text import hint_of_choice
from pbrs_farm.prepare.source import resolve, variants
from pbrs_farm.read.common.source_files import SourceFiles
from pbrs_farm.sample.camera_source import source_of
from pbrs_farm.sets.data_set import SetPart
from pbrs_farm.sets.stream import Stream, cache_root
from pbrs_farm.sets.stream_plan import StreamHome, StreamPlan
from pbrs_farm.truth.optional_layers import check_lens
from pbrs_farm.views.view_sample import LAYERS, SampleRequest

_N_VIEWS: Final = 8  # default number of views of a home in an epoch
_VERSION: Final = 1  # of the cached files


@checked_call
def stream(
    data_set: str | Path,
    *,
    layers: Any = ("colour", "normal"),
    size: Size | None = None,
    axes: str = "opencv",
    seed: Whole = 0,
    reuse: Count = 4,
    cache: str | Path = "",
    cache_gb: Positive = 10.0,
    jobs: Count = 1,
    farm: str = "",
) -> Stream:
    """Training samples of a set's file, rendered on demand.

    data_set: a set's name or file; its homes, recipe and `views` (of a home in an epoch, default 8) count, its
    forms and selection do not. layers: those of `SampleRequest`, and optional layers as stored. size: (width,
    height), None = as the parts say. axes: of normals. seed: of order and light. reuse: epochs with the same view;
    one in `reuse` homes gets new views each epoch. cache: folder, default below ~/.cache/pbrs_farm; cache_gb: its
    bound. jobs: renderers. farm: URL of the store of a farm that renders instead of this machine: all views of each home, once.

    Rendering starts now, ahead of the first reader. Raises BadInput for a set that cannot be streamed:
    one with films, rigs, a sensor, or light by Metropolis.
    """
    named = set_from_word(str(data_set))
    names: tuple[str, ...] = as_words(layers)
    request = SampleRequest(tuple(n for n in names if n in LAYERS), axes=axes)
    extra = tuple(name for name in names if name not in LAYERS)
    for name in extra:
        if name not in OPTIONAL or LAYER[name].step != "truth":
            text = "is made of the rendered light" if name in OPTIONAL else "no such layer"
            raise BadInput("layers", name, text, hint=hint_of_choice(name, (*LAYERS, *OPTIONAL)))
    homes: list[StreamHome] = []
    for part in named.parts:
        homes += _homes_of(part, size, extra, named.file)
    if farm and len(named.parts) > 1:
        text = "has several parts: a farm's store has one recipe, so one part"
        raise BadInput(named.file, "farm", text)
    inputs = [
        [h.source.house_id, h.source.fingerprint, h.recipe.digest(), h.n_views] for h in homes
    ]
    key = keys.digest(_VERSION, pbrs_farm.__version__, inputs, names, axes, seed, farm)
    plan = StreamPlan(
        named.name,
        tuple(homes),
        request,
        extra,
        seed,
        reuse,
        cache_root(cache) / f"{named.name}-{key[:12]}",
        round(cache_gb * 1e9),
        jobs,
        farm,
    )
    epoch = Stream(plan).epoch(0)
    where = farm or "this machine"
    word = "home" if len(homes) == 1 else "homes"
    text = f"{named.name}: {len(epoch)} views of {len(homes)} {word} an epoch, rendered on {where}"
    sys.stderr.write(f"{text}; cache {plan.folder}, at most {cache_gb:g} GB\n")
    return epoch


def _homes_of(
    part: SetPart, size: Size | None, layers: tuple[str, ...], file: str
) -> list[StreamHome]:
    """The homes of a part of a file; BadInput if its views are not single pictures of stored light."""
    recipe, place = part.recipe, f"part.{part.name}"
    faults = {
        "cameras: frames of a film cannot be shuffled": source_of(recipe.cameras).is_sequence,
        "rig: pictures of a rig cannot be shuffled": recipe.rig_in_use is not None,
        "sensor: pictures of stored light have no sensor": recipe.sensor.is_on,
        'light.integrator: lamps are stored by "path"': recipe.light.integrator != "path",
    }
    for text, is_fault in faults.items():
        if is_fault:
            raise BadInput(file, place, f"cannot be streamed: {text}")
    check_lens(layers, recipe.lens.lens)
    # The stream itself draws lamps that are on, another choice each epoch.
    settings: dict[str, Any] = {
        "light.groups": "lamps",
        "light.denoise": False,
        "emission.lamps_on": 1.0,
    }
    if size is not None:
        settings |= {"image.width_px": size[0], "image.height_px": size[1]}
    recipe = with_settings(recipe, settings)
    files, seeds = SourceFiles(), part.dress_seeds or (recipe.dress.seed,)
    return [
        StreamHome(word, source, recipe, part.want.n_views or _N_VIEWS)
        for word in part.homes
        for source in variants(resolve(word, files, models=part.models), seeds)
    ]
