"""The fields of a recipe, one group per stage: every constant of the paper with its section; no effects."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Final, Literal, Self

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    field_validator,
    model_serializer,
    model_validator,
)

from pbrs_farm.core.camera import DEFAULT_SIZE
from pbrs_farm.core.checked_calls import MAX_EDGE_PX, MAX_VIEW_PIXELS
from pbrs_farm.core.entries import EntryTable
from pbrs_farm.core.lighting import BULB_RADIUS_M
from pbrs_farm.core.plugins import checked_names
from pbrs_farm.core.shot import MOST_FRAMES
from pbrs_farm.core.shown_text import hint_of_choice

MAX_SAMPLES: Final = 2**20
"""Of samples, mutations and chains: far above what anyone waits for, far below what never ends."""

CAMERA_PRESETS: Final = ("paper", "released", "photo")
CAMERA_SOURCES: Final = EntryTable(
    "pbrs_farm.sample.sources", "SOURCE", "cameras", ("CameraSource",)
)
"""Of viewpoints; sample/camera_source.py has the type of an entry."""

Share = Annotated[float, Field(ge=0, le=1)]


def field(
    default: Any,
    text: str | None = None,
    low: float | None = None,
    high: float | None = None,
    *,
    above: float | None = None,
    below: float | None = None,
) -> Any:
    """A field with its description and limits: low <= value <= high, above < value < below."""
    return Field(default, description=text, ge=low, le=high, gt=above, lt=below)


def _words_of_text(value: Any) -> Any:
    """The words of a command line's "CC0:CC-BY"; other values unchanged."""
    return tuple(filter(None, value.split(":"))) if isinstance(value, str) else value


class FieldGroup(BaseModel):
    """The fields of one stage; unknown ones are errors.

    A group is added by its class and by its line in Recipe. steps: of run/plan.py, that depend on it.
    """

    steps: ClassVar[tuple[str, ...]] = ()

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class ReadFields(FieldGroup):
    """Limits for readers."""

    steps = ("house",)

    max_triangles: int = field(5_000_000, "maximum triangles of a house", high=50_000_000, above=0)
    max_model_triangles: int = field(
        2_000_000, "maximum triangles of one model", high=50_000_000, above=0
    )
    max_extent_m: float = field(
        1_000.0, "maximum distance of a piece from the origin", high=100_000.0, above=0
    )
    hidden_levels: bool = field(False, "Sweet Home 3D: also read hidden levels")
    doors: Literal["drawn", "open"] = field(
        "drawn", "Sweet Home 3D: `open` opens closed doors between rooms"
    )
    stand_ins: Literal["pieces", "boxes", "none"] = field(
        "pieces", "of items given only as class and box: furniture, boxes, nothing"
    )
    strict: bool = field(
        False, "notes of a source are errors, except harmless kinds (docs/houses/notes.md)"
    )


class DressFields(FieldGroup):
    """Dressing: makes a home look lived in, between reading and repair (docs/dress.md)."""

    steps = ("house",)

    seed: int = field(0, "seed of the dressing; 0 = not dressed", 0, below=2**32)
    surfaces: Share = field(1.0, "share of rooms with new floors and walls")
    parts: Share = field(1.0, "share of furniture with new wood, cloth and metal")
    swap: Share = field(0.7, "share of furniture replaced by another model of its class")
    library_share: Share = field(
        0.5,
        "probability of a piece from your own libraries where one fits; 0 = as likely as any other",
    )
    furniture: Share = field(
        1.0, "share of the furniture that fits along free walls and beside beds, added"
    )
    clutter: Share = field(1.0, "share of the small objects that fit on furniture, added")
    walls: Share = field(1.0, "share of pictures, mirrors, clocks, sockets and switches, added")
    textiles: Share = field(1.0, "share of curtains, blinds, rugs, pillows and blankets, added")
    lamps: Share = field(1.0, "share of rooms without a lamp that get one; 0..1")
    mess: Share = field(0.3, "untidiness of chairs, beds, tables, clothes, pictures; 0 = tidy")
    open_share: Share = field(
        0.0, "share of doors and drawers that are opened, up to the first obstacle"
    )
    float_share: float = field(
        0.0,
        "approximate share of a room's view hidden by generated objects in the air;"
        " also in homes that are not dressed",
        0,
        0.5,
    )
    style: str = Field(
        "", max_length=64, description="style of every home; empty = drawn by the seed"
    )
    furnish: Literal["none", "empty", "sparse"] = field(
        "none",
        "rooms that are furnished before dressing: `empty` = rooms without furniture,"
        " `sparse` = also rooms with little",
    )
    passes: str = Field("", max_length=256, description="passes of plugins, separated by ':'")
    catalogue: str = Field(
        "",
        max_length=4096,
        description="furniture libraries, separated by ':'; `generated` = without the package",
    )
    licences: Annotated[tuple[str, ...], BeforeValidator(_words_of_text)] = Field(
        (),
        description="licences of models and pictures from libraries, such as `CC0` and `CC-BY`;"
        " empty = any",
    )

    @model_serializer(mode="wrap")
    def _without_empty(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """The fields; no empty licences, so that digests and seeds of other recipes stay."""
        fields: dict[str, Any] = handler(self)
        return {name: value for name, value in fields.items() if name != "licences" or value}


class RepairFields(FieldGroup):
    """Geometry repair (paper section 3, "Data")."""

    steps = ("house",)

    wall_thickness_m: float = field(
        0.10, "thickness of planar walls, paper section 3", high=5, above=0
    )
    default_wall_rgb: tuple[Share, Share, Share] = field(
        (1.0, 1.0, 1.0), "sRGB of walls without a colour, paper section 3"
    )
    remove_persons: bool = field(True, "remove figures of people")
    remove_plants: bool = field(True, "remove the source's plants")
    fallback_light: bool = field(True, "add a ceiling light to rooms without any light")
    lamp_in_every_room: bool = field(
        False, "add a ceiling light to each living space without a lamp"
    )
    lamp_lx: float = field(
        0.0, "mean illuminance of the floor by an added lamp; 0 = 1,600 lm each", 0, 1_000
    )
    add_ceilings: bool = field(
        False, "add a ceiling at the walls' height to rooms with walls and no ceiling"
    )
    shade_transmission: float = field(
        0.4, "diffuse transmission of shades that enclose their bulb", 0, 1
    )
    min_light_output_ratio: float = field(
        0.2, "lamps with a lower light output ratio get a translucent shade", 0, 1
    )
    bulb_radius_m: float = field(
        BULB_RADIUS_M, "radius of a bulb if the source gives none", high=1, above=0
    )


class SurroundingFields(FieldGroup):
    """Surroundings outside the windows (docs/dress.md), which light the rooms."""

    steps = ("house",)

    kind: Literal["none", "drawn", "street", "garden", "court", "blocks", "hills"] = field(
        "none", "surroundings on all sides; drawn: by the house's seed, storey and type"
    )


class CameraFields(FieldGroup):
    """Camera sampling (paper section 3.1)."""

    steps = ("cameras", "pairs")

    preset: str = field(
        "paper", "rules and score: paper, released, or photo: as people photograph rooms"
    )
    n_sectors: int = field(6, "number of equal sectors of a room", 1, 360)
    cell_m: float = field(0.25, "cell size of the viewpoint grid", 0.05, 100)
    height_min_m: float = field(1.5, "minimum height of the eye above the floor", high=100, above=0)
    height_max_m: float = field(1.6, "maximum height of the eye", high=100, above=0)
    tilt_deg: float = field(11.0, "camera pitch, downwards", above=-90, below=90)
    tilt_sd_deg: float = field(
        0.0, "standard deviation of the pitch; 0 = fixed, as in the paper", 0, 30
    )
    roll_sd_deg: float = field(0.0, "standard deviation of the roll; 0 = level", 0, 30)
    clearance_m: float = field(0.10, "minimum distance of the eye from any obstacle", 0, 10)
    min_objects: int = field(3, "minimum number of objects in the picture", 0, 65_535)
    min_object_fraction: float = field(
        0.01, "minimum share of the picture for an object to count", 0, 1
    )
    max_item_fraction: float = field(
        1.0, "maximum share of the picture of one object; 1 = off, as in the paper", high=1, above=0
    )
    max_wall_fraction: float = field(
        1.0, "maximum share of a wall, floor or ceiling; 1 = off", high=1, above=0
    )
    max_opening_fraction: float = field(
        1.0, "photo: maximum share of all doors and windows together", high=1, above=0
    )
    min_score: float = field(0.0, "photo: views with a lower score are dropped", 0, 2)
    min_room_score: float = field(0.0, "photo: the same, for a room's best view", 0, 2)
    likeness: float = field(
        0.0,
        "photo: weight of the match between the class shares of all views and those of"
        " NYUv2; 0 = off",
        0,
        100,
    )
    hfov_rad: float = field(2 * 0.5534, "full horizontal field of view", above=0, below=3.1)
    hfov_spread: float = field(0.0, "photo: relative variation of the focal length", 0, 0.3)
    score_width_px: int = field(640, "item buffer of the final score", high=4096, above=0)
    score_height_px: int = field(480, high=4096, above=0)
    coarse_width_px: int = field(160, "item buffer of the first score", high=4096, above=0)
    coarse_height_px: int = field(120, high=4096, above=0)
    per_sector: int = field(1, "views of a sector", 1, 1000)
    source: str = Field(
        "sampled",
        max_length=4096,
        description="source of the viewpoints; a plugin's may have options: NAME,key=value",
    )
    file: str = field("", "of the sources file and trajectory")
    exact: bool = field(False, "score every candidate at full size")
    walk_frames: int = field(150, "walk: number of views", 2, MOST_FRAMES)
    walk_fps: float = field(30.0, "walk: frames per second", high=1_000, above=0)
    walk_speed_mps: float = field(0.8, "walk: maximum speed of the eye", 0.1, 10)
    walk_turn_dps: float = field(60.0, "walk: maximum turn rate, degrees per second", 5, 720)
    walk_shake: float = field(0.0, "walk: camera shake; 1 = hand-held", 0, 3)
    stereo_m: float = field(0.0, "baseline: adds a view to the right of each; 0 = off", 0, 10)

    @property
    def source_name(self) -> str:
        """The name of the source, without its options."""
        return self.source.partition(",")[0]

    @field_validator("preset")
    @classmethod
    def _preset_is_known(cls, value: str) -> str:
        if value in CAMERA_SOURCES.names():
            raise ValueError(f"{value!r} is a source: --cameras {value}")
        if value not in CAMERA_PRESETS:
            raise ValueError(f"no preset {value!r}, {hint_of_choice(value, CAMERA_PRESETS)}")
        return value

    @field_validator("source")
    @classmethod
    def _source_is_known(cls, value: str) -> str:
        name, _, options = value.partition(",")
        names = CAMERA_SOURCES.names()
        if name not in names:
            raise ValueError(f"no source {name!r}, {hint_of_choice(name, names)}")
        if options:
            CAMERA_SOURCES.entry(name).options_of(value)
        return value

    @model_validator(mode="before")
    @classmethod
    def _file_of_source(cls, data: Any) -> Any:
        """Split `NAME,file=PATH`, as command lines write it, into the fields source and file."""
        if isinstance(data, Mapping) and isinstance(word := data.get("source"), str):
            source, is_split, path = word.partition(",file=")
            if is_split:
                return {**data, "source": source, "file": path}
        return data


class ImageFields(FieldGroup):
    """Size of the pictures."""

    steps = ("tracks", "truth", "opengl_dl", "opengl_il", "light")

    width_px: int = field(DEFAULT_SIZE[0], "width of the pictures", high=MAX_EDGE_PX, above=0)
    height_px: int = field(DEFAULT_SIZE[1], high=MAX_EDGE_PX, above=0)

    @model_validator(mode="after")
    def _fits_memory(self) -> Self:
        if self.width_px * self.height_px > MAX_VIEW_PIXELS:
            raise ValueError(
                f"{self.width_px}x{self.height_px} has more than {MAX_VIEW_PIXELS} pixels"
            )
        return self


class LightFields(FieldGroup):
    """Light transport (paper section 3.2)."""

    steps = ("light", "develop")

    integrator: Literal["path", "metropolis"] = field("path", "path tracing or Metropolis")
    spp: int = field(64, "samples per pixel of `path`", 1, MAX_SAMPLES)
    direct_spp: int = field(512, "direct samples, with metropolis", 0, MAX_SAMPLES)
    mutations_per_pixel: int = field(1024, "of `metropolis`", 1, MAX_SAMPLES)
    max_depth: int = field(12, "maximum path segments", 1, 1024)
    rr_depth: int = field(1, "first vertex; 1 is the fastest of 1 to 6, docs/lab/light.md", 1, 1024)
    filter: Literal["box", "tent"] = field("tent", "reconstruction filter of a pixel's samples")
    pilot_spp: int = field(4, "32x24 pixels per emitter; 0 = uniform choice", 0, 4096)
    noise: float = field(
        0.0,
        "target relative error: `path` adds passes of spp, metropolis does fewer"
        " mutations; 0 = one pass, all mutations",
        0,
        100,
    )
    max_spp: int = field(4096, "maximum of `path` with noise or time_budget_s", 1, MAX_SAMPLES)
    time_budget_s: float = field(
        0.0, "seconds of light per view, instead of a number of samples; 0 = off", 0, 604_800
    )
    groups: Literal["two", "lamps"] = field(
        "two", "stored groups: outdoor and indoor; `lamps`: also each lamp (`path` only)"
    )
    chains: int = field(32768, "parallel Markov chains of `metropolis`", 16, MAX_SAMPLES)
    large_step: float = field(0.3, "probability of a fresh path, Kelemen 2002", above=0, below=1)
    tail_pixels: int = field(
        1024, "pixels that share the tail of a Metropolis path; 0 = its own pixel only", 0, 4096
    )
    denoise: bool = field(True, "denoise the light by Open Image Denoise")

    @model_validator(mode="after")
    def _noise_can_be_reached(self) -> Self:
        if 0 < self.noise < 1e-4:
            raise ValueError("noise below 0.0001 is never reached; 0 = one pass")
        return self

    @model_validator(mode="after")
    def _lamps_are_of_path(self) -> Self:
        if self.groups == "lamps" and self.integrator == "metropolis":
            raise ValueError("groups lamps needs `path`: add --set light.integrator=path")
        return self


class SkyFields(FieldGroup):
    """Outdoor light (docs/light.md)."""

    steps = ("illuminance", "light")

    kind: Literal["sunsky", "panorama"] = field("sunsky", "sky model, or an HDR picture")
    panoramas: str = field(
        "", "latitude-longitude HDR picture or a folder of them; empty = those of `pbrs-farm skies`"
    )
    time: Literal["day", "dusk", "night", "drawn"] = field(
        "day", "sunsky: drawn = by the house: a third dusk or night, a sixth overcast"
    )
    overcast: bool = field(False, "sunsky: an overcast sky, without a sun")
    hour: float | None = field(None, "sunsky: solar time, with latitude_deg and day_of_year", 0, 24)
    latitude_deg: float = field(48.0, "north of the equator; -z is north", -90, 90)
    day_of_year: int = field(80, "1 = 1 January; 80 = equinox", 1, 366)
    sun_elevation_deg: float | None = field(
        None, "sunsky: sun above the horizon; empty = by hour or time (by day 15 to 60)", -90, 90
    )
    sun_azimuth_deg: float | None = field(
        None, "sunsky: from -z towards +x; empty = by hour, or drawn by the house", -360, 360
    )


class EmissionFields(FieldGroup):
    """Intensity of lights."""

    steps = ("illuminance", "light")

    preset: Literal["photometric", "released"] = field("photometric", "lx and lm, or constants")
    sky_lx: float = field(
        10_000.0,
        "illuminance of open ground by a clear sky alone, sun at 30 degrees",
        high=1e7,
        above=0,
    )
    sun_lx: float = field(103_000.0, "illuminance by the sun at the zenith", 0, 1e7)
    lamp_lm: float = field(1_600.0, "flux of a Sweet Home 3D lamp of power 0.5", high=1e7, above=0)
    lm_per_watt: float = field(13.0, "luminous efficacy for SUNCG's watts", high=1e4, above=0)
    compensate_shades: bool = field(True, "flux is measured outside the shade")
    lamp_kelvin_min: float = field(2700.0, "colour temperature of bulbs", 500, 40_000)
    lamp_kelvin_max: float = field(3000.0, low=500, high=40_000)
    released_bulb: float = field(400.0, "radiance, W m-2 sr-1", 0, 1e7)
    released_shade: float = field(0.5, "radiance, W m-2 sr-1", 0, 1e7)
    released_sky: float = field(75.0, "factor of the sky's picture", 0, 1e7)
    lamps_on: Share = field(1.0, "share of the lamps that are on, drawn by home and lamp")

    @model_serializer(mode="wrap")
    def _without_switches(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """The fields; lamps_on only if some are off, so that digests and seeds of other recipes stay."""
        fields: dict[str, Any] = handler(self)
        return {name: value for name, value in fields.items() if name != "lamps_on" or value < 1}


class MaterialFields(FieldGroup):
    """Materials (paper section 3.2; presets in docs/spec/suncg.md section 6)."""

    steps = ("illuminance", "light")

    preset: Literal["physical", "released"] = field("physical", "docs/spec/suncg.md")


class ToneFields(FieldGroup):
    """Radiance to 8 bits."""

    steps = ("develop",)

    preset: Literal["photo", "released"] = field("photo", "as photographs, or as the paper")
    key: float = field(0.18, "released: Reinhard's key value", high=1000, above=0)
    white_balance: float = field(0.7, "correction of the light's colour; 0 = none, 1 = white", 0, 1)
    camera: Literal["neutral", "snapshot", "phone", "slr", "webcam", "kinect", "drawn"] = field(
        "neutral",
        "photo: camera of the pictures (docs/light.md); drawn: phone, slr, webcam or kinect per view",
    )
    variants: int = field(0, "more pictures of mlt_il_ol, by random cameras", 0, 8)
    warmth_ev: float = field(0.0, "red over blue after white balance, stops", -4, 4)
    tint_ev: float = field(0.0, "green over red and blue after white balance, stops", -4, 4)
    white: float = field(10.0, "photo: radiance that becomes 255, over matt white", 1, 1e6)
    flare: Share = field(0.002, "photo: veiling glare, share of the mean light added to all pixels")
    glare: Share = field(0.0, "share of the light spread widely around bright areas")
    exposure_ev: float = field(0.0, "photo: exposure above the key, stops", -8, 8)
    contrast: float = field(1.42, "photo: slope of the tone curve at mid-grey; 1 = none", 0.25, 4)
    local_contrast: Share = field(
        0.0, "photo: compression of large differences of light; keeps detail"
    )
    sharpening: float = field(0.0, "photo: amount of unsharp masking", 0, 4)
    pictures: str = Field(
        "", max_length=256, description="additional pictures of plugins, separated by ':'"
    )

    @field_validator("pictures")
    @classmethod
    def _pictures_are_known(cls, value: str) -> str:
        return checked_names("pictures", value)


class RasterFields(FieldGroup):
    """The OpenGL modes."""

    steps = ("opengl_dl", "opengl_il")

    samples: int = field(4, "samples per pixel", 1, 64)
    lights_per_object: int = field(8, "brightest lights of an object, paper section 3.2", 1, 256)


class HistogramFields(FieldGroup):
    """Histograms and quality of a view (paper section 3.3), in powers of two that sum to coarser bins."""

    steps = ("view",)

    colour_space: Literal["rgb", "ycbcr"] = field("rgb", "sRGB-encoded; joint bins")
    colour_bins: Literal[2, 4, 8, 16] = field(8, "per channel, three channels jointly")
    depth_bins: Literal[8, 16, 32, 64, 128, 256] = field(128, "depth_min_m to depth_max_m")
    depth_min_m: float = field(0.0, "nearer depths count in the first bin", 0, 1e6)
    depth_max_m: float = field(10.0, "farther depths count in the last bin", high=1e6, above=0)
    near_m: float = field(0.25, "nearer surfaces count as touching the camera", high=1e6, above=0)
    object_fraction: float = field(
        0.01, "minimum share of the picture for an object to count", 0, 1
    )

    @model_validator(mode="after")
    def _depth_grows(self) -> Self:
        if self.depth_max_m <= self.depth_min_m:
            raise ValueError("depth_max_m must be above depth_min_m")
        return self


class SelectionFields(FieldGroup):
    """Image selection (paper section 3.3) and the thresholds of image quality."""

    min_colour: float = field(0.70, "minimum colour similarity, paper section 3.3", 0, 1)
    min_depth: float = field(0.70, "minimum depth similarity, paper section 3.3", 0, 1)
    score_mode: Literal["mlt_il_ol", "mlt_ol", "opengl_il", "opengl_dl"] = field(
        "mlt_il_ol", "mode to score if a view has no mlt_il_ol"
    )
    per_room_cap: int = field(0, "maximum views per room, best first; 0 = all", 0, 1_000_000_000)
    balance: Literal["none", "classes"] = field(
        "none", "keep a subset of the kept views that balances the classes"
    )
    balance_share: float = field(0.5, "share of the kept views in that subset", high=1, above=0)
    black_modes: Literal["scored", "light", "all"] = field(
        "scored", "modes that must not be black: scored, path-traced, all"
    )
    min_brightness: float = field(0.06, "minimum median sRGB luma", 0, 1)
    max_blown: float = field(0.50, "maximum share of saturated pixels", 0, 1)
    max_surface: float = field(0.85, "maximum share of one instance", 0, 1)
    max_near: float = field(0.30, "maximum share nearer than near_m", 0, 1)
    min_objects: int = field(3, "minimum number of objects above object_fraction", 0, 65_535)
    max_noise: float = field(1.0, "maximum relative error of the raw light", 0, 1e6)
    min_room_lx: float = field(
        0.0, "minimum illuminance of a room's floor by all light; darker rooms get no views", 0, 1e6
    )
    max_missing_textures: int = field(3, "maximum missing textures of the house", 0, 1_000_000)
