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
from pbrs_farm.core.shown_text import hint_of_choice

MAX_SAMPLES: Final = 2**20
"""Of samples, mutations and chains: far above what anyone waits for, far below what never ends."""

CAMERA_PRESETS: Final = ("paper", "released", "photo")
CAMERA_SOURCES: Final = EntryTable(
    "pbrs_farm.sample.sources", "SOURCE", "cameras", ("CameraSource",)
)
"""Of viewpoints; sample/camera_source.py has the type of an entry."""

Share = Annotated[float, Field(ge=0, le=1)]


class FieldGroup(BaseModel):
    """The fields of one stage; unknown ones are errors.

    A group is added by its class and by its line in Recipe. steps: of run/plan.py, that depend on it.
    """

    steps: ClassVar[tuple[str, ...]] = ()

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class ReadFields(FieldGroup):
    """Limits for readers."""

    steps = ("house",)

    max_triangles: int = Field(
        5_000_000, gt=0, le=50_000_000, description="most triangles of a house; more is refused"
    )
    max_model_triangles: int = Field(
        2_000_000, gt=0, le=50_000_000, description="most triangles of one model; more is refused"
    )
    max_extent_m: float = Field(
        1_000.0,
        gt=0,
        le=100_000.0,
        description="farthest from the origin; a piece beyond it is refused",
    )
    hidden_levels: bool = Field(False, description="Sweet Home 3D: read levels not shown, too")
    doors: Literal["drawn", "open"] = Field(
        "drawn", description="Sweet Home 3D: `open` swings shut doors between rooms open"
    )
    stand_ins: Literal["pieces", "boxes", "none"] = Field(
        "pieces",
        description="for what a source tells by class and box alone: furniture, plain boxes, nothing",
    )
    strict: bool = Field(
        False,
        description="notes of a source are errors but the harmless kinds, docs/houses/notes.md",
    )


class DressFields(FieldGroup):
    """Dressing: how far a home is made to look lived in, between reading and repair (docs/dress.md)."""

    steps = ("house",)

    seed: int = Field(0, ge=0, lt=2**32, description="seed of what is chosen; 0 = not dressed")
    surfaces: Share = Field(1.0, description="share of rooms that get floors and walls of a style")
    parts: Share = Field(1.0, description="share of furniture whose wood, cloth and metal change")
    swap: Share = Field(
        0.7, description="share of furniture that another model of its class replaces"
    )
    own_share: Share = Field(
        0.5,
        description="how often a piece of your own libraries is chosen where one fits; 0 = as often"
        " as any other",
    )
    furniture: Share = Field(
        1.0, description="share of the furniture that fits along free walls and beside beds"
    )
    clutter: Share = Field(1.0, description="share of the things that fit on furniture")
    walls: Share = Field(
        1.0, description="share of pictures, mirrors, clocks, sockets and switches"
    )
    textiles: Share = Field(1.0, description="share of curtains, blinds, rugs, pillows, blankets")
    lamps: Share = Field(1.0, description="share of rooms without a lamp that get one")
    mess: Share = Field(
        0.3, description="how little was tidied up: chairs, beds, tables, clothes, pictures"
    )
    open_share: Share = Field(
        0.0,
        description="share of doors and drawers that stand open, as far as nothing is in their way",
    )
    float_share: float = Field(
        0.0,
        ge=0,
        le=0.5,
        description="share of what one sees in a room that generated things in the air hide, about;"
        " also of homes that are not dressed",
    )
    style: str = Field(
        "", max_length=64, description="the style of every home; empty = drawn by the seed"
    )
    furnish: Literal["none", "empty", "sparse"] = Field(
        "none",
        description="rooms that get furniture first: `empty` = those that have none, `sparse` = those"
        " with little too",
    )
    passes: str = Field(
        "", max_length=256, description="plugins' passes after our own, ':' between"
    )
    catalogue: str = Field(
        "", max_length=4096,
        description="libraries beside the furniture package, ':' between; `generated` = no package",
    )  # fmt: skip


class RepairFields(FieldGroup):
    """Geometry repair (paper section 3, "Data")."""

    steps = ("house",)

    wall_thickness_m: float = Field(
        0.10, gt=0, le=5, description="thickness of planar walls, paper section 3"
    )
    default_wall_rgb: tuple[Share, Share, Share] = Field(
        (1.0, 1.0, 1.0), description="sRGB of walls without a colour, paper section 3"
    )
    remove_persons: bool = True
    remove_plants: bool = True
    fallback_light: bool = Field(True, description="a ceiling light where nothing lights a room")
    lamp_in_every_room: bool = Field(
        False, description="a ceiling light in each room where people live that has no lamp"
    )
    lamp_lx: float = Field(
        0.0,
        ge=0,
        le=1_000,
        description="mean on the floor that an added lamp is sized for; 0 = 1,600 lm each",
    )
    add_ceilings: bool = Field(
        False, description="a ceiling at the walls' height over rooms that have walls and none"
    )
    shade_transmission: float = Field(
        0.4, ge=0, le=1, description="diffuse transmission of shades that enclose their bulb"
    )
    min_escape: float = Field(
        0.2,
        ge=0,
        le=1,
        description="lamps whose light output ratio is below this get a translucent shade",
    )
    bulb_radius_m: float = Field(
        BULB_RADIUS_M, gt=0, le=1, description="radius of a bulb where the source gives none"
    )


class SurroundingFields(FieldGroup):
    """Surroundings before the windows (docs/dress/outside.md), which light the rooms."""

    steps = ("house",)

    kind: Literal["none", "drawn", "street", "garden", "court", "blocks", "hills"] = Field(
        "none", description="on all sides; drawn: by the house's seed, storey and kind of home"
    )


class CameraFields(FieldGroup):
    """Camera sampling (paper section 3.1)."""

    steps = ("cameras", "pairs")

    preset: str = Field(
        "paper",
        description="whose rules and score: paper, released; photo: as people photograph rooms",
    )
    n_sectors: int = Field(6, ge=1, le=360, description="sectors of a room, of equal angles")
    cell_m: float = Field(0.25, ge=0.05, le=100, description="edge of the viewpoint grid")
    height_min_m: float = Field(1.5, gt=0, le=100, description="eye above the floor's surface")
    height_max_m: float = Field(1.6, gt=0, le=100)
    tilt_deg: float = Field(11.0, gt=-90, lt=90, description="downwards")
    tilt_sd_deg: float = Field(
        0.0,
        ge=0,
        le=30,
        description="of a normal spread about tilt_deg; 0 = fixed, as in the paper",
    )
    roll_sd_deg: float = Field(
        0.0, ge=0, le=30, description="of a normal spread of the roll about level; 0 = level"
    )
    clearance_m: float = Field(
        0.10, ge=0, le=10, description="least distance of the eye from any obstacle"
    )
    min_objects: int = Field(3, ge=0, le=65_535)
    min_object_fraction: float = Field(
        0.01, ge=0, le=1, description="least share of the picture for an object to count"
    )
    max_item_fraction: float = Field(
        1.0,
        gt=0,
        le=1,
        description="largest share of the picture of one object; 1 = off, as in the paper",
    )
    max_wall_fraction: float = Field(
        1.0, gt=0, le=1, description="the same of a wall, floor or ceiling; 1 = off"
    )
    max_opening_fraction: float = Field(
        1.0, gt=0, le=1, description="photo: of the picture, of all doors and windows together"
    )
    min_score: float = Field(
        0.0, ge=0, le=2, description="photo: views of a lower score are left out"
    )
    min_room_score: float = Field(
        0.0, ge=0, le=2, description="photo: but a room's best view stays from here on"
    )
    likeness: float = Field(
        0.0,
        ge=0,
        le=100,
        description="photo: weight, beside the score, of how near the class shares of all views are to"
        " NYUv2's; 0 = off",
    )
    hfov_rad: float = Field(2 * 0.5534, gt=0, lt=3.1, description="full horizontal field of view")
    hfov_spread: float = Field(
        0.0, ge=0, le=0.3, description="photo: part by which the focal length varies, either way"
    )
    score_width_px: int = Field(640, gt=0, le=4096)
    score_height_px: int = Field(480, gt=0, le=4096)
    coarse_width_px: int = Field(160, gt=0, le=4096)
    coarse_height_px: int = Field(120, gt=0, le=4096)
    per_sector: int = Field(1, ge=1, le=1000)
    source: str = Field(
        "sampled",
        max_length=4096,
        description="where viewpoints come from, with the options of a plugin's source: NAME,key=value",
    )
    file: str = Field("", description="camera or trajectory file of the user's, for those sources")
    exact: bool = Field(False, description="score every candidate at full size")
    walk_frames: int = Field(150, ge=2, le=100_000, description="walk: views along it")
    walk_fps: float = Field(30.0, gt=0, le=1_000, description="walk: frames a second")
    walk_speed_mps: float = Field(0.8, ge=0.1, le=10, description="walk: of the eye, at most")
    walk_turn_dps: float = Field(60.0, ge=5, le=720, description="walk: degrees a second, at most")
    walk_shake: float = Field(0.0, ge=0, le=3, description="walk: 1 = as a hand holds a camera")
    stereo_m: float = Field(
        0.0, ge=0, le=10, description="baseline: a view more to the right of each; 0 = none"
    )

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

    width_px: int = Field(DEFAULT_SIZE[0], gt=0, le=MAX_EDGE_PX)
    height_px: int = Field(DEFAULT_SIZE[1], gt=0, le=MAX_EDGE_PX)

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
    spp: int = Field(64, ge=1, le=MAX_SAMPLES, description="samples per pixel of `path`")
    direct_spp: int = Field(
        512, ge=0, le=MAX_SAMPLES, description="direct samples beside Metropolis"
    )
    mutations_per_pixel: int = Field(1024, ge=1, le=MAX_SAMPLES)
    max_depth: int = Field(
        12, ge=1, le=1024, description="path segments; Russian roulette from rr_depth"
    )
    rr_depth: int = Field(
        1, ge=1, le=1024, description="first vertex; docs/lab/light.md: measured the best of 1 to 6"
    )
    filter: Literal["box", "tent"] = Field(
        "tent", description="reconstruction filter of a pixel's samples"
    )
    pilot_spp: int = Field(
        4, ge=0, le=4096, description="32x24 pixels per emitter; 0 = uniform choice"
    )
    noise: float = Field(
        0.0,
        ge=0,
        le=100,
        description="relative error to end at: `path` goes on in passes of spp, metropolis makes"
        " fewer mutations; 0 = one pass, all mutations",
    )
    max_spp: int = Field(
        4096, ge=1, le=MAX_SAMPLES, description="of `path` when it renders to a noise or a time"
    )
    time_budget_s: float = Field(
        0.0,
        ge=0,
        le=604_800,
        description="seconds of light a view, instead of samples or mutations; 0 = off",
    )
    groups: Literal["two", "lamps"] = Field(
        "two", description="outdoor and indoor; `lamps`: a layer for each lamp, too (`path`)"
    )
    chains: int = Field(
        32768, ge=16, le=MAX_SAMPLES, description="Markov chains of `metropolis`, in parallel"
    )
    large_step: float = Field(0.3, gt=0, lt=1, description="chance of a fresh path, Kelemen 2002")
    tail_pixels: int = Field(
        1024,
        ge=0,
        le=4096,
        description="pixels that a Metropolis path's suffix is shown to; 0 = its own alone",
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
    """Outdoor light (docs/spec/sky.md)."""

    steps = ("illuminance", "light")

    kind: Literal["sunsky", "panorama"] = "sunsky"
    panoramas: str = Field(
        "",
        description="folder of latitude-longitude HDR pictures, or one; empty = `pbrs-farm skies`",
    )
    time: Literal["day", "dusk", "night", "drawn"] = Field(
        "day",
        description="sunsky: drawn = by the house: dusk or night of a third, overcast of a sixth",
    )
    overcast: bool = Field(False, description="sunsky: an overcast sky, without a sun")
    hour: float | None = Field(
        None, ge=0, le=24, description="sunsky: by the sun; its place by latitude_deg, day_of_year"
    )
    latitude_deg: float = Field(
        48.0, ge=-90, le=90, description="north of the equator; -z is north"
    )
    day_of_year: int = Field(
        80, ge=1, le=366, description="1 = 1 January; 80 = day and night alike"
    )
    sun_elevation_deg: float | None = Field(
        None,
        ge=-90,
        le=90,
        description="sunsky: above the horizon; none = by hour or time, by day drawn, 15 to 60",
    )
    sun_azimuth_deg: float | None = Field(
        None,
        ge=-360,
        le=360,
        description="sunsky: from -z towards +x; none = by hour, or drawn by the house",
    )


class EmissionFields(FieldGroup):
    """How strong lights are."""

    steps = ("illuminance", "light")

    preset: Literal["photometric", "released"] = "photometric"
    sky_lx: float = Field(
        10_000.0,
        gt=0,
        le=1e7,
        description="illuminance of open ground by a clear sky without sun, which stands at 30 degrees",
    )
    sun_lx: float = Field(
        103_000.0, ge=0, le=1e7, description="the sun's, facing it, when it stands at the zenith"
    )
    lamp_lm: float = Field(1_600.0, gt=0, le=1e7, description="a Sweet Home 3D lamp of power 0.5")
    lm_per_watt: float = Field(13.0, gt=0, le=1e4, description="SUNCG's watts")
    compensate_shades: bool = Field(True, description="flux is what leaves the lamp, shade and all")
    lamp_kelvin_min: float = Field(2700.0, ge=500, le=40_000)
    lamp_kelvin_max: float = Field(3000.0, ge=500, le=40_000)
    released_bulb: float = Field(400.0, ge=0, le=1e7, description="radiance, W m-2 sr-1")
    released_shade: float = Field(0.5, ge=0, le=1e7, description="radiance, W m-2 sr-1")
    released_sky: float = Field(75.0, ge=0, le=1e7, description="factor of the sky's picture")


class MaterialFields(FieldGroup):
    """Materials (paper section 3.2; presets in docs/spec/suncg.md section 6)."""

    steps = ("illuminance", "light")

    preset: Literal["physical", "released"] = "physical"


class ToneFields(FieldGroup):
    """Radiance to 8 bits."""

    steps = ("develop",)

    preset: Literal["photo", "released"] = "photo"
    key: float = Field(0.18, gt=0, le=1000, description="released: Reinhard's key value")
    white_balance: float = Field(
        0.7,
        ge=0,
        le=1,
        description="how far the light's colour is turned to white; 1 = all the way",
    )
    camera: Literal["neutral", "phone", "slr", "webcam", "kinect", "drawn"] = Field(
        "neutral",
        description="photo: what takes the pictures (docs/light.md); drawn: one of these a view",
    )
    variants: int = Field(
        0, ge=0, le=8, description="more pictures of mlt_il_ol, each by a camera that is drawn"
    )
    warmth_ev: float = Field(0.0, ge=-4, le=4, description="stops of red over blue after balance")
    tint_ev: float = Field(0.0, ge=-4, le=4, description="stops of green over both after balance")
    white: float = Field(
        10.0, ge=1, le=1e6, description="photo: radiance over a matt white's that becomes 255"
    )
    flare: Share = Field(
        0.002, description="photo: of the picture's mean light, as a veil over all of it"
    )
    glare: Share = Field(0.0, description="of the light, spread wide about what is bright")
    exposure_ev: float = Field(0.0, ge=-8, le=8, description="photo: stops above the key")
    contrast: float = Field(
        1.42, ge=0.25, le=4, description="photo: slope of encoded tones about the middle; 1 = none"
    )
    local_contrast: Share = Field(
        0.0, description="photo: how far large differences of light are taken out, detail kept"
    )
    sharpening: float = Field(
        0.0, ge=0, le=4, description="photo: of the difference to a blurred picture, added"
    )
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

    samples: int = Field(4, ge=1, le=64, description="per pixel, resolved")
    lights_per_object: int = Field(8, ge=1, le=256, description="best ones, paper section 3.2")


class HistogramFields(FieldGroup):
    """The histograms of a view and its quality numbers, written beside it (paper section 3.3).

    Bins are powers of two, so that every coarser binning is an exact sum of these.
    """

    steps = ("view",)

    colour_space: Literal["rgb", "ycbcr"] = Field("rgb", description="sRGB-encoded; joint bins")
    colour_bins: Literal[2, 4, 8, 16] = Field(8, description="per channel, three channels jointly")
    depth_bins: Literal[8, 16, 32, 64, 128, 256] = 128
    depth_min_m: float = Field(0.0, ge=0, le=1e6, description="nearer counts as the first bin")
    depth_max_m: float = Field(10.0, gt=0, le=1e6, description="farther counts as the last bin")
    near_m: float = Field(
        0.25, gt=0, le=1e6, description="what is nearer counts as touching the camera"
    )
    object_fraction: float = Field(0.01, ge=0, le=1, description="of the picture, to be an object")

    @model_validator(mode="after")
    def _depth_grows(self) -> Self:
        if self.depth_max_m <= self.depth_min_m:
            raise ValueError("depth_max_m must be above depth_min_m")
        return self


class SelectionFields(FieldGroup):
    """Image selection (paper section 3.3) and the thresholds of image quality."""

    min_colour: float = Field(0.70, ge=0, le=1, description="kept when above, paper section 3.3")
    min_depth: float = Field(0.70, ge=0, le=1, description="kept when above, paper section 3.3")
    score_mode: Literal["mlt_il_ol", "mlt_ol", "opengl_il", "opengl_dl"] = Field(
        "mlt_il_ol", description="scored where a view lacks mlt_il_ol"
    )
    per_room_cap: int = Field(
        0, ge=0, le=1_000_000_000, description="best views kept per room; 0 = all"
    )
    balance: Literal["none", "classes"] = Field(
        "none", description="take of the kept views those that balance the classes"
    )
    balance_share: float = Field(0.5, gt=0, le=1, description="share of the kept views taken")
    black_modes: Literal["scored", "light", "all"] = Field(
        "scored", description="modes whose picture must not be black: scored, path-traced, all"
    )
    min_brightness: float = Field(0.06, ge=0, le=1, description="median sRGB luma; too dark below")
    max_blown: float = Field(0.50, ge=0, le=1, description="share of saturated pixels")
    max_surface: float = Field(0.85, ge=0, le=1, description="share of the largest instance")
    max_near: float = Field(0.30, ge=0, le=1, description="share nearer than near_m: inside it")
    min_objects: int = Field(3, ge=0, le=65_535, description="objects of object_fraction and more")
    max_noise: float = Field(1.0, ge=0, le=1e6, description="relative error of the raw light")
    min_room_lx: float = Field(
        0.0,
        ge=0,
        le=1e6,
        description="by all light on a room's floor; views of darker rooms are not made",
    )
    max_missing_textures: int = Field(3, ge=0, le=1_000_000, description="of the house")
