"""Options of `run` and `submit`: one field each, with type, default, limits and help.

The only list of options. Both command lines, a job's file, `pf.render_homes` and the farm's JobSpec are
made from these fields: a new field of Wanted is an option of both verbs, an entry of job.toml, and
travels to every worker. commands/options.py makes the command line. No effects.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Annotated, Final, Literal

from pydantic import BeforeValidator

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.layers import LAYER, LIGHT_LAYERS, OPTIONAL
from pbrs_farm.core.lighting import ALL_MODES, Mode
from pbrs_farm.core.options import option, options_of
from pbrs_farm.core.recipe import CAMERA_SOURCES, RECIPE_NAMES
from pbrs_farm.core.record import Record
from pbrs_farm.core.shown_text import hint_of_choice

# Options under one title in the help.
_dressing_option = partial(option, group="dressing")
_recipe_option = partial(option, group="recipe")
_light_option = partial(option, group="light")
_viewpoints_option = partial(option, group="viewpoints")
_output_option = partial(option, group="output")
_processes_option = partial(option, group="processes")


class LibraryOptions(Record):
    """Libraries for dressing beside the furniture package."""

    catalogue: tuple[str, ...] = _dressing_option(
        (),
        "add a furniture library, repeatable: .sh3f (models), .sh3t (textures), a folder of OBJ or GLB,"
        " 3D-FUTURE, hssd-models or objathor; `generated` omits the furniture package",
        metavar="LIBRARY",
    )
    pictures: tuple[str, ...] = _dressing_option(
        (),
        "folder of JPEG or PNG files to hang as pictures on walls, repeatable",
        metavar="DIR",
        into="catalogue",
    )


class DressOptions(Record):
    """By which seeds each home is dressed, and with what."""

    dress: str | None = _dressing_option(
        None,
        "seeds for dressing; each gives one more variant of each home: 3, 1..20 or 1,4,7",
        metavar="SEEDS",
    )
    furnish: Literal["none", "empty", "sparse"] | None = _dressing_option(
        None,
        "before dressing, furnish rooms without furniture (empty) or with little (sparse) (docs/homes.md)",
        sets="dress.furnish",
    )


class RecipeOptions(Record):
    """The recipe by name, and what overrides its fields."""

    recipe: str = _recipe_option(
        "fast", f"{', '.join(RECIPE_NAMES)}, or a FILE.toml (default {{default}})"
    )
    set: tuple[str, ...] = _recipe_option(
        (), "override a field; `recipes` lists them", metavar="GROUP.FIELD=VALUE"
    )
    size: str | None = _recipe_option(None, "picture size, e.g. 640x480", metavar="WxH")
    strict: bool = _recipe_option(False, "treat recoverable faults of a home as errors")


class SeededRecipeOptions(RecipeOptions):
    """As RecipeOptions, with the recipe's seed."""

    seed: int | None = _recipe_option(None, "seed of the recipe (default 0)", sets="seed")


class LightOptions(Record):
    """Duration of light and its stored groups: short forms of the recipe's fields."""

    noise: str | None = _light_option(
        None,
        "stop the light of a view at this estimated relative error, e.g. 0.05 (light.noise):"
        " path adds samples, metropolis does fewer mutations",
        metavar="E",
        sets="light.noise",
    )
    time_budget: str | None = _light_option(
        None,
        "seconds of light per view, instead of a number of samples or mutations (light.time_budget_s)",
        metavar="S",
        sets="light.time_budget_s",
    )
    groups: Literal["two", "lamps"] | None = _light_option(
        None,
        "lamps: also store the light of each lamp, for `relight VIEW --lamp` (light.groups;"
        " path only; default two: outdoor and indoor)",
        sets="light.groups",
    )


class CameraOptions(Record):
    """Where viewpoints come from."""

    cameras: str | None = _viewpoints_option(
        None,
        f"source of the viewpoints: {', '.join(CAMERA_SOURCES.names())} (docs/cameras.md)",
        metavar="SOURCE",
        sets="cameras.source",
    )
    trajectory: Path | None = _viewpoints_option(
        None,
        "follow this path: rows of TUM's format, t x y z qx qy qz qw (docs/motion.md)",
        metavar="FILE",
    )
    frames: int | None = _viewpoints_option(
        None, "number of frames of a walk (default 150)", metavar="N", sets="cameras.walk_frames"
    )
    fps: float | None = _viewpoints_option(
        None, "frames per second of a walk (default 30)", metavar="F", sets="cameras.walk_fps"
    )
    doors: Literal["drawn", "open"] | None = _viewpoints_option(
        None,
        "open: open the doors between rooms if their model has a hinge (read.doors; default drawn)",
        sets="read.doors",
    )
    stereo: float | None = _viewpoints_option(
        None,
        "add a second view B metres to the right of each, e.g. 0.065",
        metavar="B",
        sets="cameras.stereo_m",
    )
    rig: Path | None = _viewpoints_option(
        None, "take each view with the cameras of this rig.toml (docs/cameras.md)", metavar="FILE"
    )


class ModelsOption(Record):
    """The folder of the models that a home's file names."""

    models: str = option(
        "",
        "folder of the models of an HSSD, 3D-FRONT or Holodeck scene (docs/houses/data_sets.md)",
        metavar="DIR",
    )


def _modes(given: object) -> object:
    """Modes, by name or as Mode, in the order of ALL_MODES; BadInput for an unknown name."""
    if isinstance(given, str) or not isinstance(given, Iterable):
        return given
    names = [mode.value for mode in ALL_MODES]
    mode_names = [str(mode) for mode in given]
    for name in mode_names:
        if name not in names:
            hint = hint_of_choice(name, names)
            raise BadInput("--modes", name, "no such lighting mode", hint=hint)
    return tuple(mode for mode in ALL_MODES if mode.value in mode_names)


class Wanted(Record):
    """The products of each house: the options that `run`, `submit` and every worker share.

    A new field needs no code elsewhere but its use. Modes may be given by name; no mode means labels alone.

        >>> Wanted(modes=("mlt_ol", "opengl_dl")).modes[0].value
        'opengl_dl'
    """

    modes: Annotated[tuple[Mode, ...], BeforeValidator(_modes)] = _output_option(
        ALL_MODES,
        "lighting modes: opengl_dl opengl_il mlt_ol mlt_il_ol (default all)",
        metavar="MODE",
        many_words=True,
    )
    layers: tuple[str, ...] = _output_option(
        (),
        "optional layers to add to the default ones; `layers` lists them",
        metavar="LAYER",
        many_words=True,
    )
    n_views: int = _output_option(
        0,
        "at most N views per home (default: all)",
        ge=0,
        name="views",
        metavar="N",
        least=1,
        hint="omit it for all views",
    )
    pairs: bool = _output_option(
        False,
        "write pairs.parquet: overlap and relative pose of each two views of a room (docs/motion.md)",
    )
    tracks: bool = _output_option(
        False,
        "write tracks.npz: surface points tracked through the frames of a walk (docs/motion.md)",
    )
    drop_radiance: bool = _output_option(
        False,
        "remove each finished view's radiance.exr, most of its bytes, which `relight` and --update read",
    )


def wanted_of(request: Wanted) -> Wanted:
    """The `Wanted` of a request or job, its layers and those they need in order; BadInput for unusable ones."""
    want = Wanted(**{name: getattr(request, name) for name in Wanted.model_fields})
    for layer in want.layers:
        if layer not in LAYER:
            raise BadInput("--layers", layer, "no such layer", hint=hint_of_choice(layer, OPTIONAL))
        if layer in LIGHT_LAYERS and not any(mode.groups for mode in want.modes):
            text, hint = "needs a path-traced mode", "--modes mlt_ol mlt_il_ol"
            raise BadInput("--layers", layer, text, hint=hint)
    layer_names = {name for layer in want.layers for name in (layer, *LAYER[layer].beside)}
    return want.model_copy(update={"layers": tuple(x for x in OPTIONAL if x in layer_names)})


class ProcessLimitOptions(Record):
    """Number and limits of the processes of a run on this machine."""

    jobs: int = _processes_option(
        1,
        "render processes (default 1, plus one for all steps but light); each view uses all cores",
        metavar="N",
        least=1,
    )
    step_timeout: float = _processes_option(
        3600.0, "time limit of a step, seconds (default 3600)", metavar="S"
    )
    silence: float = _processes_option(
        0.0,
        "restart a process without a sign of life for S seconds (default: as --step-timeout)",
        metavar="S",
        least=0,
    )
    memory: float = _processes_option(
        0.0, "memory limit of a process (default: its share of the machine)", metavar="MB", least=0
    )


class ProcessOptions(ProcessLimitOptions):
    """How this machine's processes do a run."""

    update: bool = _processes_option(
        False, "replace the recipe of the output folder; repeat changed steps"
    )
    as_json: bool = _processes_option(False, "print a JSON line per event", name="json")


class Request(Wanted, LightOptions, SeededRecipeOptions, LibraryOptions, DressOptions):
    """Shared options of `run` and `submit`: dressing, recipe, light, and products."""


class RunRequest(ProcessOptions, Request):
    """Options of `run` and `demo` beside the homes."""


class ObjectsRequest(ProcessOptions, Wanted, LightOptions, SeededRecipeOptions):
    """Options of `objects` beside the models, without dressing."""


SHORT_FORMS: Final = {
    name: shown.sets
    for model in (DressOptions, SeededRecipeOptions, LightOptions, CameraOptions)
    for name, (_field, shown) in options_of(model).items()
    if shown.sets
}
"""Options that are short forms -> the recipe's field."""
