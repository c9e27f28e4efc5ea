"""The stable names for plugins: like those of `pbrs_farm`, they stay from version to version.

Everything else in the package may change with any version. docs/plugins.md describes each kind of
plugin; examples/plugins has a package of each. A removed name keeps working for one minor version with a
warning, and the changelog names its replacement.

    from pbrs_farm.plugin import BadHouse, Format, House

Names are imported on first use. No effects.
"""

from __future__ import annotations

from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from pbrs_farm.core.arrays import HitRecord as HitRecord
    from pbrs_farm.core.camera import Camera as Camera
    from pbrs_farm.core.camera import Intrinsics as Intrinsics
    from pbrs_farm.core.camera import View as View
    from pbrs_farm.core.catalogue import Catalogue as Catalogue
    from pbrs_farm.core.catalogue import Piece as Piece
    from pbrs_farm.core.catalogue import Place as Place
    from pbrs_farm.core.classes import NYU40_NAMES as NYU40_NAMES
    from pbrs_farm.core.classes import OTHERFURNITURE as OTHERFURNITURE
    from pbrs_farm.core.classes import OTHERPROP as OTHERPROP
    from pbrs_farm.core.errors import BadHouse as BadHouse
    from pbrs_farm.core.errors import BadInput as BadInput
    from pbrs_farm.core.errors import BadRecipe as BadRecipe
    from pbrs_farm.core.errors import MachineFailed as MachineFailed
    from pbrs_farm.core.house import Box as Box
    from pbrs_farm.core.house import House as House
    from pbrs_farm.core.house import Item as Item
    from pbrs_farm.core.house import ItemKind as ItemKind
    from pbrs_farm.core.house import Level as Level
    from pbrs_farm.core.house import LightPart as LightPart
    from pbrs_farm.core.house import Material as Material
    from pbrs_farm.core.house import MaterialKind as MaterialKind
    from pbrs_farm.core.house import Note as Note
    from pbrs_farm.core.house import Opening as Opening
    from pbrs_farm.core.house import Room as Room
    from pbrs_farm.core.house import Source as Source
    from pbrs_farm.core.house import Surface as Surface
    from pbrs_farm.core.house import Texture as Texture
    from pbrs_farm.core.keys import sha256 as sha256
    from pbrs_farm.core.layers import Layer as Layer
    from pbrs_farm.core.layers import optional_layer as optional_layer
    from pbrs_farm.core.lighting import LightForm as LightForm
    from pbrs_farm.core.lighting import PowerUnit as PowerUnit
    from pbrs_farm.core.options import option as option
    from pbrs_farm.core.recipe import CameraFields as CameraFields
    from pbrs_farm.core.recipe import ReadFields as ReadFields
    from pbrs_farm.core.recipe import ToneFields as ToneFields
    from pbrs_farm.core.record import Record as Record
    from pbrs_farm.core.shot import view_id as view_id
    from pbrs_farm.dress.mutable_house import MutableHouse as MutableHouse
    from pbrs_farm.dress.style import Style as Style
    from pbrs_farm.dress.thing_materials import glass as glass
    from pbrs_farm.dress.thing_materials import glossy as glossy
    from pbrs_farm.dress.thing_materials import plain as plain
    from pbrs_farm.export.chosen_view import Choice as Choice
    from pbrs_farm.export.chosen_view import ChosenView as ChosenView
    from pbrs_farm.export.form import HomeForm as HomeForm
    from pbrs_farm.export.form import ViewForm as ViewForm
    from pbrs_farm.furnishings.things.cloth import draped as draped
    from pbrs_farm.furnishings.things.cloth import sheet as sheet
    from pbrs_farm.furnishings.things.maker import Maker as Maker
    from pbrs_farm.furnishings.things.maker import Size as Size
    from pbrs_farm.furnishings.things.maker import family as family
    from pbrs_farm.furnishings.things.maker import thing as thing
    from pbrs_farm.geometry.bodies import bevelled as bevelled
    from pbrs_farm.geometry.bodies import board as board
    from pbrs_farm.geometry.bodies import cylinder as cylinder
    from pbrs_farm.geometry.bodies import disc as disc
    from pbrs_farm.geometry.bodies import frustum as frustum
    from pbrs_farm.geometry.bodies import loft as loft
    from pbrs_farm.geometry.bodies import revolve as revolve
    from pbrs_farm.geometry.bodies import rounded as rounded
    from pbrs_farm.geometry.bodies import slab as slab
    from pbrs_farm.geometry.bodies import tube as tube
    from pbrs_farm.geometry.bodies import vessel as vessel
    from pbrs_farm.geometry.outlines import oval as oval
    from pbrs_farm.geometry.outlines import rect as rect
    from pbrs_farm.geometry.solids import boxes_surface as boxes_surface
    from pbrs_farm.images import exr_from_layers as exr_from_layers
    from pbrs_farm.raycast.caster import Caster as Caster
    from pbrs_farm.read.common.format import Format as Format
    from pbrs_farm.read.common.format import GivenFile as GivenFile
    from pbrs_farm.read.common.notes import Notes as Notes
    from pbrs_farm.sample.camera_source import CameraRequest as CameraRequest
    from pbrs_farm.sample.camera_source import CameraSource as CameraSource
    from pbrs_farm.sample.camera_source import Sampling as Sampling
    from pbrs_farm.scene.home import Home as Home
    from pbrs_farm.transport.develop.mode_pictures import LinearAovs as LinearAovs
    from pbrs_farm.transport.develop.mode_pictures import develop as develop
    from pbrs_farm.truth.optional_layers import LabelInputs as LabelInputs

# Module -> its names for plugins.
# fmt: off
_MODULES: Final = {
    "core.arrays": ("HitRecord",),
    "core.camera": ("Camera", "Intrinsics", "View"),
    "core.catalogue": ("Catalogue", "Piece", "Place"),
    "core.classes": ("NYU40_NAMES", "OTHERFURNITURE", "OTHERPROP"),
    "core.errors": ("BadHouse", "BadInput", "BadRecipe", "MachineFailed"),
    "core.house": (
        "Box", "House", "Item", "ItemKind", "Level", "LightPart", "Material", "MaterialKind", "Note",
        "Opening", "Room", "Source", "Surface", "Texture",
    ),
    "core.keys": ("sha256",),
    "core.layers": ("Layer", "optional_layer"),
    "core.lighting": ("LightForm", "PowerUnit"),
    "core.options": ("option",),
    "core.recipe": ("CameraFields", "ReadFields", "ToneFields"),
    "core.record": ("Record",),
    "core.shot": ("view_id",),
    "dress.mutable_house": ("MutableHouse",),
    "dress.style": ("Style",),
    "geometry.bodies": (
        "bevelled", "board", "cylinder", "disc", "frustum", "loft", "rounded", "slab", "tube", "revolve",
        "vessel",
    ),
    "furnishings.things.cloth": ("draped", "sheet"),
    "furnishings.things.maker": ("Maker", "Size", "family", "thing"),
    "dress.thing_materials": ("glass", "glossy", "plain"),
    "geometry.outlines": ("oval", "rect"),
    "export.chosen_view": ("Choice", "ChosenView"),
    "export.form": ("HomeForm", "ViewForm"),
    "geometry.solids": ("boxes_surface",),
    "images": ("exr_from_layers",),
    "raycast.caster": ("Caster",),
    "read.common.format": ("Format", "GivenFile"),
    "read.common.notes": ("Notes",),
    "sample.camera_source": ("CameraRequest", "CameraSource", "Sampling"),
    "scene.home": ("Home",),
    "transport.develop.mode_pictures": ("LinearAovs", "develop"),
    "truth.optional_layers": ("LabelInputs",),
}
# fmt: on
_PLACES: Final = {name: f"pbrs_farm.{m}:{name}" for m, names in _MODULES.items() for name in names}

__all__ = [*_PLACES]


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module 'pbrs_farm.plugin' has no attribute {name!r}")
    globals()[name] = value = resolve_name(_PLACES[name])
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_PLACES})
