"""The fields of a recipe, one group per stage: every constant of the paper with its section; no effects."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Final, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

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


class FieldGroup(BaseModel):
    """The fields of one stage; unknown ones are errors.

    A group is added by its class and by its line in Recipe. steps: of run/plan.py, that depend on it.
    """

    steps: ClassVar[tuple[str, ...]] = ()

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class ReadFields(FieldGroup):
    """Limits for readers."""

    steps = ("house",)

    max_triangles: int = field(
        5_000_000, "most triangles of a house; more is refused", high=50_000_000, above=0
    )
    max_model_triangles: int = field(
        2_000_000, "most triangles of one model; more is refused", high=50_000_000, above=0
    )
    max_extent_m: float = field(
        1_000.0, "farthest from the origin; a piece beyond it is refused", high=100_000.0, above=0
    )
    hidden_levels: bool = field(False, "Sweet Home 3D: read levels not shown, too")
    doors: Literal["drawn", "open"] = field(
        "drawn", "Sweet Home 3D: `open` swings shut doors between rooms open"
    )
    stand_ins: Literal["pieces", "boxes", "none"] = field(
        "pieces", "for what a source tells by class and box alone: furniture, plain boxes, nothing"
    )
    strict: bool = field(
        False, "notes of a source are errors but the harmless kinds, docs/houses/notes.md"
    )


class DressFields(FieldGroup):
    """Dressing: how far a home is made to look lived in, between reading and repair (docs/dress.md)."""

    steps = ("house",)

    seed: int = field(0, "seed of what is chosen; 0 = not dressed", 0, below=2**32)
    surfaces: Share = field(1.0, "share of rooms that get floors and walls of a style")
    parts: Share = field(1.0, "share of furniture whose wood, cloth and metal change")
    swap: Share = field(0.7, "share of furniture that another model of its class replaces")
    own_share: Share = field(
        0.5,
        "how often a piece of your own libraries is chosen where one fits; 0 = as often"
        " as any other",
    )
    furniture: Share = field(
        1.0, "share of the furniture that fits along free walls and beside beds"
    )
    clutter: Share = field(1.0, "share of the things that fit on furniture")
    walls: Share = field(1.0, "share of pictures, mirrors, clocks, sockets and switches")
    textiles: Share = field(1.0, "share of curtains, blinds, rugs, pillows, blankets")
    lamps: Share = field(1.0, "share of rooms without a lamp that get one")
    mess: Share = field(0.3, "how little was tidied up: chairs, beds, tables, clothes, pictures")
    open_share: Share = field(
        0.0, "share of doors and drawers that stand open, as far as nothing is in their way"
    )
    float_share: float = field(
        0.0,
        "share of what one sees in a room that generated things in the air hide, about;"
        " also of homes that are not dressed",
        0,
        0.5,
    )
    style: str = Field(
        "", max_length=64, description="the style of every home; empty = drawn by the seed"
    )
    furnish: Literal["none", "empty", "sparse"] = field(
        "none",
        "rooms that get furniture first: `empty` = those that have none, `sparse` = those"
        " with little too",
    )
    passes: str = Field(
        "", max_length=256, description="plugins' passes after our own, ':' between"
    )
    catalogue: str = Field(
        "",
        max_length=4096,
        description="libraries beside the furniture package, ':' between; `generated` = no package",
    )


class RepairFields(FieldGroup):
    """Geometry repair (paper section 3, "Data")."""

    steps = ("house",)

    wall_thickness_m: float = field(
        0.10, "thickness of planar walls, paper section 3", high=5, above=0
    )
    default_wall_rgb: tuple[Share, Share, Share] = field(
        (1.0, 1.0, 1.0), "sRGB of walls without a colour, paper section 3"
    )
    remove_persons: bool = True
    remove_plants: bool = True
    fallback_light: bool = field(True, "a ceiling light where nothing lights a room")
    lamp_in_every_room: bool = field(
        False, "a ceiling light in each room where people live that has no lamp"
    )
    lamp_lx: float = field(
        0.0, "mean on the floor that an added lamp is sized for; 0 = 1,600 lm each", 0, 1_000
    )
    add_ceilings: bool = field(
        False, "a ceiling at the walls' height over rooms that have walls and none"
    )
    shade_transmission: float = field(
        0.4, "diffuse transmission of shades that enclose their bulb", 0, 1
    )
    min_escape: float = field(
        0.2, "lamps whose light output ratio is below this get a translucent shade", 0, 1
    )
    bulb_radius_m: float = field(
        BULB_RADIUS_M, "radius of a bulb where the source gives none", high=1, above=0
    )


class SurroundingFields(FieldGroup):
    """Surroundings before the windows (docs/dress.md), which light the rooms."""

    steps = ("house",)

    kind: Literal["none", "drawn", "street", "garden", "court", "blocks", "hills"] = field(
        "none", "on all sides; drawn: by the house's seed, storey and kind of home"
    )


class CameraFields(FieldGroup):
    """Camera sampling (paper section 3.1)."""

    steps = ("cameras", "pairs")

    preset: str = field(
        "paper", "whose rules and score: paper, released; photo: as people photograph rooms"
    )
    n_sectors: int = field(6, "sectors of a room, of equal angles", 1, 360)
    cell_m: float = field(0.25, "edge of the viewpoint grid", 0.05, 100)
    height_min_m: float = field(1.5, "eye above the floor's surface", high=100, above=0)
    height_max_m: float = field(1.6, high=100, above=0)
    tilt_deg: float = field(11.0, "downwards", above=-90, below=90)
    tilt_sd_deg: float = field(
        0.0, "of a normal spread about tilt_deg; 0 = fixed, as in the paper", 0, 30
    )
    roll_sd_deg: float = field(0.0, "of a normal spread of the roll about level; 0 = level", 0, 30)
    clearance_m: float = field(0.10, "least distance of the eye from any obstacle", 0, 10)
    min_objects: int = field(3, low=0, high=65_535)
    min_object_fraction: float = field(
        0.01, "least share of the picture for an object to count", 0, 1
    )
    max_item_fraction: float = field(
        1.0, "largest share of the picture of one object; 1 = off, as in the paper", high=1, above=0
    )
    max_wall_fraction: float = field(
        1.0, "the same of a wall, floor or ceiling; 1 = off", high=1, above=0
    )
    max_opening_fraction: float = field(
        1.0, "photo: of the picture, of all doors and windows together", high=1, above=0
    )
    min_score: float = field(0.0, "photo: views of a lower score are left out", 0, 2)
    min_room_score: float = field(0.0, "photo: but a room's best view stays from here on", 0, 2)
    likeness: float = field(
        0.0,
        "photo: weight, beside the score, of how near the class shares of all views are to"
        " NYUv2's; 0 = off",
        0,
        100,
    )
    hfov_rad: float = field(2 * 0.5534, "full horizontal field of view", above=0, below=3.1)
    hfov_spread: float = field(
        0.0, "photo: part by which the focal length varies, either way", 0, 0.3
    )
    score_width_px: int = field(640, high=4096, above=0)
    score_height_px: int = field(480, high=4096, above=0)
    coarse_width_px: int = field(160, high=4096, above=0)
    coarse_height_px: int = field(120, high=4096, above=0)
    per_sector: int = field(1, low=1, high=1000)
    source: str = Field(
        "sampled",
        max_length=4096,
        description="where viewpoints come from, with the options of a plugin's source: NAME,key=value",
    )
    file: str = field("", "camera or trajectory file of the user's, for those sources")
    exact: bool = field(False, "score every candidate at full size")
    walk_frames: int = field(150, "walk: views along it", 2, MOST_FRAMES)
    walk_fps: float = field(30.0, "walk: frames a second", high=1_000, above=0)
    walk_speed_mps: float = field(0.8, "walk: of the eye, at most", 0.1, 10)
    walk_turn_dps: float = field(60.0, "walk: degrees a second, at most", 5, 720)
    walk_shake: float = field(0.0, "walk: 1 = as a hand holds a camera", 0, 3)
    stereo_m: float = field(0.0, "baseline: a view more to the right of each; 0 = none", 0, 10)

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

    width_px: int = field(DEFAULT_SIZE[0], high=MAX_EDGE_PX, above=0)
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

    integrator: Literal["path", "metropolis"] = "path"
    spp: int = field(64, "samples per pixel of `path`", 1, MAX_SAMPLES)
    direct_spp: int = field(512, "direct samples beside Metropolis", 0, MAX_SAMPLES)
    mutations_per_pixel: int = field(1024, low=1, high=MAX_SAMPLES)
    max_depth: int = field(12, "path segments; Russian roulette from rr_depth", 1, 1024)
    rr_depth: int = field(
        1, "first vertex; docs/lab/light.md: measured the best of 1 to 6", 1, 1024
    )
    filter: Literal["box", "tent"] = field("tent", "reconstruction filter of a pixel's samples")
    pilot_spp: int = field(4, "32x24 pixels per emitter; 0 = uniform choice", 0, 4096)
    noise: float = field(
        0.0,
        "relative error to end at: `path` goes on in passes of spp, metropolis makes"
        " fewer mutations; 0 = one pass, all mutations",
        0,
        100,
    )
    max_spp: int = field(4096, "of `path` when it renders to a noise or a time", 1, MAX_SAMPLES)
    time_budget_s: float = field(
        0.0, "seconds of light a view, instead of samples or mutations; 0 = off", 0, 604_800
    )
    groups: Literal["two", "lamps"] = field(
        "two", "outdoor and indoor; `lamps`: a layer for each lamp, too (`path`)"
    )
    chains: int = field(32768, "Markov chains of `metropolis`, in parallel", 16, MAX_SAMPLES)
    large_step: float = field(0.3, "chance of a fresh path, Kelemen 2002", above=0, below=1)
    tail_pixels: int = field(
        1024, "pixels that a Metropolis path's suffix is shown to; 0 = its own alone", 0, 4096
    )
    denoise: bool = True

    @model_validator(mode="after")
    def _noise_can_be_reached(self) -> Self:
        if 0 < self.noise < 1e-4:
            raise ValueError("noise below 0.0001 is never reached; 0 = one pass")
        return self

    @model_validator(mode="after")
    def _lamps_are_of_path(self) -> Self:
        if self.groups == "lamps" and self.integrator == "metropolis":
            raise ValueError("groups lamps is of `path` alone: add --set light.integrator=path")
        return self


class SkyFields(FieldGroup):
    """Outdoor light (docs/light.md)."""

    steps = ("illuminance", "light")

    kind: Literal["sunsky", "panorama"] = "sunsky"
    panoramas: str = field(
        "", "folder of latitude-longitude HDR pictures, or one; empty = `pbrs-farm skies`"
    )
    time: Literal["day", "dusk", "night", "drawn"] = field(
        "day", "sunsky: drawn = by the house: dusk or night of a third, overcast of a sixth"
    )
    overcast: bool = field(False, "sunsky: an overcast sky, without a sun")
    hour: float | None = field(
        None, "sunsky: by the sun; its place by latitude_deg, day_of_year", 0, 24
    )
    latitude_deg: float = field(48.0, "north of the equator; -z is north", -90, 90)
    day_of_year: int = field(80, "1 = 1 January; 80 = day and night alike", 1, 366)
    sun_elevation_deg: float | None = field(
        None, "sunsky: above the horizon; none = by hour or time, by day drawn, 15 to 60", -90, 90
    )
    sun_azimuth_deg: float | None = field(
        None, "sunsky: from -z towards +x; none = by hour, or drawn by the house", -360, 360
    )


class EmissionFields(FieldGroup):
    """How strong lights are."""

    steps = ("illuminance", "light")

    preset: Literal["photometric", "released"] = "photometric"
    sky_lx: float = field(
        10_000.0,
        "illuminance of open ground by a clear sky without sun, which stands at 30 degrees",
        high=1e7,
        above=0,
    )
    sun_lx: float = field(103_000.0, "the sun's, facing it, when it stands at the zenith", 0, 1e7)
    lamp_lm: float = field(1_600.0, "a Sweet Home 3D lamp of power 0.5", high=1e7, above=0)
    lm_per_watt: float = field(13.0, "SUNCG's watts", high=1e4, above=0)
    compensate_shades: bool = field(True, "flux is what leaves the lamp, shade and all")
    lamp_kelvin_min: float = field(2700.0, low=500, high=40_000)
    lamp_kelvin_max: float = field(3000.0, low=500, high=40_000)
    released_bulb: float = field(400.0, "radiance, W m-2 sr-1", 0, 1e7)
    released_shade: float = field(0.5, "radiance, W m-2 sr-1", 0, 1e7)
    released_sky: float = field(75.0, "factor of the sky's picture", 0, 1e7)


class MaterialFields(FieldGroup):
    """Materials (paper section 3.2; presets in docs/spec/suncg.md section 6)."""

    steps = ("illuminance", "light")

    preset: Literal["physical", "released"] = "physical"


class ToneFields(FieldGroup):
    """Radiance to 8 bits."""

    steps = ("develop",)

    preset: Literal["photo", "released"] = "photo"
    key: float = field(0.18, "released: Reinhard's key value", high=1000, above=0)
    white_balance: float = field(
        0.7, "how far the light's colour is turned to white; 1 = all the way", 0, 1
    )
    camera: Literal["neutral", "phone", "slr", "webcam", "kinect", "drawn"] = field(
        "neutral", "photo: what takes the pictures (docs/light.md); drawn: one of these a view"
    )
    variants: int = field(0, "more pictures of mlt_il_ol, each by a camera that is drawn", 0, 8)
    warmth_ev: float = field(0.0, "stops of red over blue after balance", -4, 4)
    tint_ev: float = field(0.0, "stops of green over both after balance", -4, 4)
    white: float = field(10.0, "photo: radiance over a matt white's that becomes 255", 1, 1e6)
    flare: Share = field(0.002, "photo: of the picture's mean light, as a veil over all of it")
    glare: Share = field(0.0, "of the light, spread wide about what is bright")
    exposure_ev: float = field(0.0, "photo: stops above the key", -8, 8)
    contrast: float = field(
        1.42, "photo: slope of encoded tones about the middle; 1 = none", 0.25, 4
    )
    local_contrast: Share = field(
        0.0, "photo: how far large differences of light are taken out, detail kept"
    )
    sharpening: float = field(0.0, "photo: of the difference to a blurred picture, added", 0, 4)
    pictures: str = Field(
        "", max_length=256, description="plugins' pictures beside the modes', ':' between"
    )

    @field_validator("pictures")
    @classmethod
    def _pictures_are_known(cls, value: str) -> str:
        return checked_names("pictures", value)


class RasterFields(FieldGroup):
    """The OpenGL modes."""

    steps = ("opengl_dl", "opengl_il")

    samples: int = field(4, "per pixel, resolved", 1, 64)
    lights_per_object: int = field(8, "best ones, paper section 3.2", 1, 256)


class HistogramFields(FieldGroup):
    """The histograms of a view and its quality numbers, written beside it (paper section 3.3).

    Bins are powers of two, so that every coarser binning is an exact sum of these.
    """

    steps = ("view",)

    colour_space: Literal["rgb", "ycbcr"] = field("rgb", "sRGB-encoded; joint bins")
    colour_bins: Literal[2, 4, 8, 16] = field(8, "per channel, three channels jointly")
    depth_bins: Literal[8, 16, 32, 64, 128, 256] = 128
    depth_min_m: float = field(0.0, "nearer counts as the first bin", 0, 1e6)
    depth_max_m: float = field(10.0, "farther counts as the last bin", high=1e6, above=0)
    near_m: float = field(0.25, "what is nearer counts as touching the camera", high=1e6, above=0)
    object_fraction: float = field(0.01, "of the picture, to be an object", 0, 1)

    @model_validator(mode="after")
    def _depth_grows(self) -> Self:
        if self.depth_max_m <= self.depth_min_m:
            raise ValueError("depth_max_m must be above depth_min_m")
        return self


class SelectionFields(FieldGroup):
    """Image selection (paper section 3.3) and the thresholds of image quality."""

    min_colour: float = field(0.70, "kept when above, paper section 3.3", 0, 1)
    min_depth: float = field(0.70, "kept when above, paper section 3.3", 0, 1)
    score_mode: Literal["mlt_il_ol", "mlt_ol", "opengl_il", "opengl_dl"] = field(
        "mlt_il_ol", "scored where a view lacks mlt_il_ol"
    )
    per_room_cap: int = field(0, "best views kept per room; 0 = all", 0, 1_000_000_000)
    balance: Literal["none", "classes"] = field(
        "none", "take of the kept views those that balance the classes"
    )
    balance_share: float = field(0.5, "share of the kept views taken", high=1, above=0)
    black_modes: Literal["scored", "light", "all"] = field(
        "scored", "modes whose picture must not be black: scored, path-traced, all"
    )
    min_brightness: float = field(0.06, "median sRGB luma; too dark below", 0, 1)
    max_blown: float = field(0.50, "share of saturated pixels", 0, 1)
    max_surface: float = field(0.85, "share of the largest instance", 0, 1)
    max_near: float = field(0.30, "share nearer than near_m: inside it", 0, 1)
    min_objects: int = field(3, "objects of object_fraction and more", 0, 65_535)
    max_noise: float = field(1.0, "relative error of the raw light", 0, 1e6)
    min_room_lx: float = field(
        0.0, "by all light on a room's floor; views of darker rooms are not made", 0, 1e6
    )
    max_missing_textures: int = field(3, "of the house", 0, 1_000_000)
