"""Every constant of the paper as a named field with its section; presets; overrides. Effect: reads its presets.

A recipe is a full set of fields in groups, one group per stage, so that a step's digest covers
the groups it uses and nothing else. `--set group.field=value` overrides any field.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any, Final, Self, get_args

from pydantic import ValidationError, model_validator
from pydantic_core import ErrorDetails

from pbrs_farm.core import keys
from pbrs_farm.core.camera import Intrinsics
from pbrs_farm.core.checked_json import place_in, sentence
from pbrs_farm.core.errors import BadRecipe
from pbrs_farm.core.optics_fields import BlurFields as BlurFields
from pbrs_farm.core.optics_fields import LensFields as LensFields
from pbrs_farm.core.optics_fields import SensorFields as SensorFields
from pbrs_farm.core.picture_cameras import DRAWN, PictureCamera, picture_camera
from pbrs_farm.core.recipe_fields import CAMERA_SOURCES as CAMERA_SOURCES
from pbrs_farm.core.recipe_fields import CameraFields as CameraFields
from pbrs_farm.core.recipe_fields import DressFields as DressFields
from pbrs_farm.core.recipe_fields import EmissionFields as EmissionFields
from pbrs_farm.core.recipe_fields import FieldGroup, field
from pbrs_farm.core.recipe_fields import HistogramFields as HistogramFields
from pbrs_farm.core.recipe_fields import ImageFields as ImageFields
from pbrs_farm.core.recipe_fields import LightFields as LightFields
from pbrs_farm.core.recipe_fields import MaterialFields as MaterialFields
from pbrs_farm.core.recipe_fields import RasterFields as RasterFields
from pbrs_farm.core.recipe_fields import ReadFields as ReadFields
from pbrs_farm.core.recipe_fields import RepairFields as RepairFields
from pbrs_farm.core.recipe_fields import SelectionFields as SelectionFields
from pbrs_farm.core.recipe_fields import SkyFields as SkyFields
from pbrs_farm.core.recipe_fields import SurroundingFields as SurroundingFields
from pbrs_farm.core.recipe_fields import ToneFields as ToneFields
from pbrs_farm.core.record import read_toml
from pbrs_farm.core.rig_fields import RigFields as RigFields
from pbrs_farm.core.rig_fields import stereo_rig
from pbrs_farm.core.shot import Shot
from pbrs_farm.core.shown_text import hint_of_choice, near_names, question


class Recipe(FieldGroup):
    """The full set of fields one output root is made with.

    >>> recipe_from_name("preview").image.width_px
    320
    """

    name: str = "fast"
    seed: int = field(0, low=0, below=2**64)
    read: ReadFields = ReadFields()
    dress: DressFields = DressFields()
    repair: RepairFields = RepairFields()
    surroundings: SurroundingFields = SurroundingFields()
    cameras: CameraFields = CameraFields()
    rig: RigFields | None = field(None, "cameras of --rig")
    lens: LensFields = LensFields()
    blur: BlurFields = BlurFields()
    sensor: SensorFields = SensorFields()
    image: ImageFields = ImageFields()
    light: LightFields = LightFields()
    sky: SkyFields = SkyFields()
    emission: EmissionFields = EmissionFields()
    materials: MaterialFields = MaterialFields()
    tone: ToneFields = ToneFields()
    raster: RasterFields = RasterFields()
    histogram: HistogramFields = HistogramFields()
    selection: SelectionFields = SelectionFields()

    @model_validator(mode="after")
    def _lens_fits(self) -> Self:
        """The lens gives every pixel one ray, at the picture's size."""
        f = self.cameras
        chosen = Intrinsics.from_hfov(f.score_width_px, f.score_height_px, f.hfov_rad)
        for place, lens in self.lenses.items():
            fault = lens.aspect_fault(self.image.width_px, self.image.height_px)
            if fault is not None:
                raise ValueError(f"{place}{fault}")
            lens.intrinsics(chosen)
        return self

    @model_validator(mode="after")
    def _is_one_rig(self) -> Self:
        if self.rig is not None and self.cameras.stereo_m > 0:
            raise ValueError("rig: give rig or cameras.stereo_m")
        return self

    @property
    def rig_in_use(self) -> RigFields | None:
        """The cameras that take each view together: of a stereo pair two, None where there is one."""
        stereo_m = self.cameras.stereo_m
        return stereo_rig(stereo_m) if stereo_m > 0 else self.rig

    def shot(self, view_id: str) -> Shot:
        """The shot of a view of this recipe, by its id."""
        rig = self.rig_in_use
        return Shot.of_id(view_id, () if rig is None else rig.eyes)

    @property
    def lenses(self) -> dict[str, LensFields]:
        """The lens of all views, and those of a rig's cameras by their place in messages."""
        of_rig = () if self.rig is None else self.rig.cameras
        rig_lenses = {f"rig camera {c.name}: ": c.lens for c in of_rig if c.lens is not None}
        return {"": self.lens, **rig_lenses}

    @model_validator(mode="after")
    def _blur_fits(self) -> Self:
        """Blur is of `path`, and depth of field of a lens with an optical axis."""
        if self.blur.is_on and self.light.integrator == "metropolis":
            raise ValueError("group blur needs `path`: add --set light.integrator=path")
        for place, lens in self.lenses.items():
            if self.blur.aperture_mm > 0 and not lens.lens.depth_is_planar:
                text = f"{place}blur.aperture_mm: lens.model {lens.model} has no plane of focus"
                raise ValueError(text)
        return self

    @property
    def judged_cameras(self) -> CameraFields:
        """The group `cameras` by which views are chosen: with the field of view of the recipe's lens.

        A pin-hole or radtan lens that states a focal length has one field of view and one aspect, which
        no candidate's zoom changes; views of other lenses are chosen through the group's own pin-hole.
        """
        f, lens = self.cameras, self.lens
        if lens.fx == 0 or not lens.lens.depth_is_planar:
            return f
        lens_view = {
            "hfov_rad": 2 * math.atan(0.5 * lens.width_px / lens.fx),
            "hfov_spread": 0.0,
            "score_height_px": max(round(f.score_width_px * lens.height_px / lens.width_px), 1),
            "coarse_height_px": max(round(f.coarse_width_px * lens.height_px / lens.width_px), 1),
        }
        return f.model_copy(update=lens_view)

    def camera_of(self, house_id: str, view_id: str, variant: int = 0) -> PictureCamera:
        """The camera that develops one view: tone.camera, or a drawn one for a variant.

        It is drawn once a take, so all cameras of a rig and all frames of a film share its errors. The
        same house, view and recipe seed give the same camera on every machine.

            >>> recipe_from_name("fast").camera_of("a-1", "0_0_1").name
            'neutral'
        """
        seed = self.shot(view_id).seed(house_id, "camera", variant, self.seed, per="take")
        name = DRAWN if variant else self.tone.camera
        return picture_camera(name, self.tone, self.sensor, seed)

    def __init__(self, **fields: Any) -> None:
        try:
            super().__init__(**fields)
        except ValidationError as error:
            lines = "; ".join(map(_fault, error.errors(include_url=False)))
            raise BadRecipe(lines, hint="`pbrs-farm recipes` lists every field") from None

    def digest(self, *groups: str) -> str:
        """Digest of the seed and the named groups; of all fields but the name when none is named.

        >>> recipe_from_name("fast").digest() == recipe_from_name("fast", {"light.spp": "64"}).digest()
        False
        """
        return _digest_of_fields(self.model_dump(mode="json", exclude={"name"}), groups)

    def picture_digest(self, *groups: str) -> str:
        """As digest, without light.groups: it adds layers and changes no picture, so no seed.

        >>> isinstance(recipe_from_name("fast").picture_digest(), str)
        True
        """
        fields = self.model_dump(mode="json", exclude={"name": True, "light": {"groups"}})
        return _digest_of_fields(fields, groups)


def _digest_of_fields(fields: Mapping[str, Any], groups: tuple[str, ...]) -> str:
    # Leave out absent groups, as before they were introduced.
    chosen = ("seed", *groups) if groups else fields
    return keys.digest({g: fields[g] for g in chosen if fields[g] is not None})


_ROWS: Final = read_toml(Path(__file__).with_name("recipes.toml"), dict[str, dict[str, Any]])
_PRESETS: Final = {
    name: {**_ROWS.get(row.pop("base", ""), {}), **row} for name, row in _ROWS.items()
}

RECIPE_NAMES = tuple(_PRESETS)


def recipe_from_name(name: str, overrides: Mapping[str, str] | None = None) -> Recipe:
    """The named preset with overrides ("group.field" -> JSON text, else a string); raises BadRecipe."""
    if name not in _PRESETS:
        raise BadRecipe(f"no recipe {name!r}", hint=hint_of_choice(name, RECIPE_NAMES))
    return changed_recipe(name, name, {}, overrides or {})


def changed_recipe(
    name: str, base: str, changes: Mapping[str, Any], overrides: Mapping[str, str]
) -> Recipe:
    """A recipe: preset base, then changes (group -> field -> value), then overrides; raises BadRecipe."""
    # Start from the preset, then override field by field; pydantic judges the whole.
    fields: dict[str, Any] = {"name": name}
    for group, values in _PRESETS[base].items():
        fields[group] = dict(values)
    for group, value in changes.items():
        preset_value = fields.get(group)
        join = isinstance(preset_value, dict) and isinstance(value, Mapping)
        fields[group] = {**preset_value, **value} if join and preset_value is not None else value
    for path, text in overrides.items():
        _set(fields, path, text)
    return Recipe(**fields)


def with_settings(recipe: Recipe, settings: Mapping[str, Any]) -> Recipe:
    """A copy of the recipe with other values of some fields, "light.spp" -> 64. Raises as changed_recipe.

    Only the given fields are kept: a preset of a sensor or lens fills the other fields again, so that
    changing the preset changes all fields it implies. Values are validated as from a file.
    """
    if not settings:
        return recipe
    fields = recipe.model_dump(exclude_unset=True)
    for path, value in settings.items():
        group, _, field = path.partition(".")
        if not field:
            fields[group] = value
        elif isinstance(fields.setdefault(group, {}), dict):
            fields[group][field] = value
    return Recipe(**fields)


def _fault(fault: ErrorDetails) -> str:
    """The error of a field; for an unknown one with similar names."""
    path, text, value = place_in(fault["loc"]), sentence(fault), fault["input"]
    if not path:  # of groups that do not fit each other
        return text
    if fault["type"] != "extra_forbidden":
        return f"{path}: {text}"
    # For an unknown group name the field that was set in it.
    if isinstance(value, dict) and value:
        path = f"{path}.{next(iter(value))}"
    # A field without its group, or in another's, is found in every group that has it.
    paths = field_paths()
    same = [p for p in paths if p.endswith(f".{path.rpartition('.')[2]}")]
    offer = question(near_names(path, same) or same[:2] or near_names(path, paths))
    return f"{path}: {text}" + (f", {offer}" if offer else "")


def field_paths() -> list[str]:
    """Every field as --set names it, in the order of the model: "seed", "light.spp" ..."""
    paths = []
    for group, info in Recipe.model_fields.items():
        fields = getattr(info.annotation, "model_fields", None)
        paths += [group] if fields is None else [f"{group}.{name}" for name in fields]
    return paths


@cache
def groups_of_step(step: str) -> tuple[str, ...]:
    """The groups that a step depends on, in the order of the model.

    >>> groups_of_step("develop")
    ('sensor', 'light', 'tone')
    """
    return tuple(name for name, group in groups() if step in group.steps)


@cache
def picture_groups() -> tuple[str, ...]:
    """The groups that any step depends on; those of selection make nothing."""
    return tuple(name for name, group in groups() if group.steps)


def groups() -> Iterator[tuple[str, type[FieldGroup]]]:
    """Name and class of each group, in the order of the model."""
    for name, info in Recipe.model_fields.items():
        for kind in (info.annotation, *get_args(info.annotation)):  # `RigFields | None` is one, too
            if isinstance(kind, type) and issubclass(kind, FieldGroup):
                yield name, kind


def recipe_from_json(data: bytes, place: str) -> Recipe:
    """Read a stored recipe.json; BadRecipe naming its place. A person's .toml: formats.recipe_toml."""
    try:
        return Recipe.model_validate_json(data)
    except (ValidationError, BadRecipe):
        raise BadRecipe(f"{place}: is not a recipe of this version") from None


def _set(fields: dict[str, Any], path: str, text: str) -> None:
    try:
        value = json.loads(text)
    except ValueError:
        value = text
    group, _, field = path.partition(".")
    if not field:
        fields[group] = value
    elif isinstance(fields.setdefault(group, {}), dict):
        fields[group][field] = value


def differences(a: Recipe, b: Recipe) -> list[str]:
    """ "group.field: a -> b" for every field that differs, names aside; None for a missing field."""
    lines: list[str] = []

    def walk(x: Any, y: Any, path: str) -> None:
        if isinstance(x, dict) and isinstance(y, dict):
            for k in sorted(set(x) | set(y)):
                walk(x.get(k), y.get(k), f"{path}.{k}" if path else str(k))
        elif x != y:
            lines.append(f"{path}: {x} -> {y}")

    walk(
        a.model_dump(mode="json", exclude={"name"}), b.model_dump(mode="json", exclude={"name"}), ""
    )
    return lines
