"""pbrs_farm: houses designed by people in, physically-based pictures with exact labels out.

    import pbrs_farm as pf

    home = pf.load("Studio").dress(seed=3)
    camera = home.cameras("photo", n=1)[0]
    frame = pf.render(home, camera, layers=["albedo"])
    frame.colour, frame.depth, frame.instances

The names of this module and of `pbrs_farm.plugin` stay from version to version; all others may move. Names are
imported when they are first used: importing the package itself takes milliseconds.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from pbrs_farm.commands.streaming import stream as stream
    from pbrs_farm.core.camera import Camera as Camera
    from pbrs_farm.core.errors import BadHouse as BadHouse
    from pbrs_farm.core.errors import BadInput as BadInput
    from pbrs_farm.core.errors import BadRecipe as BadRecipe
    from pbrs_farm.core.errors import MachineFailed as MachineFailed
    from pbrs_farm.core.errors import PbrsError as PbrsError
    from pbrs_farm.core.errors import RenderFailed as RenderFailed
    from pbrs_farm.core.errors import StoreFailed as StoreFailed
    from pbrs_farm.core.recipe import Recipe as Recipe
    from pbrs_farm.export.export_views import export as export_views
    from pbrs_farm.scene.generated_models import generate_model as generate_model
    from pbrs_farm.scene.home import Home as Home
    from pbrs_farm.scene.home import load as load
    from pbrs_farm.scene.home import make as make
    from pbrs_farm.scene.models import Model as Model
    from pbrs_farm.scene.models import model as model
    from pbrs_farm.scene.models import models as models
    from pbrs_farm.scene.pictures import film as film
    from pbrs_farm.scene.pictures import render as render
    from pbrs_farm.scene.pictures import render_homes as render_homes
    from pbrs_farm.views.open_views import open_views as open
    from pbrs_farm.views.packing.pack_shards import pack as pack
    from pbrs_farm.views.packing.packing_plan import Packing as Packing
    from pbrs_farm.views.view_sample import SampleRequest as SampleRequest
    from pbrs_farm.views.views import Frame as Frame

    __version__: str

# Public name -> module:name.
_PUBLIC: Final = {
    "BadHouse": "pbrs_farm.core.errors:BadHouse",
    "BadInput": "pbrs_farm.core.errors:BadInput",
    "BadRecipe": "pbrs_farm.core.errors:BadRecipe",
    "MachineFailed": "pbrs_farm.core.errors:MachineFailed",
    "PbrsError": "pbrs_farm.core.errors:PbrsError",
    "RenderFailed": "pbrs_farm.core.errors:RenderFailed",
    "StoreFailed": "pbrs_farm.core.errors:StoreFailed",
    "Camera": "pbrs_farm.core.camera:Camera",
    "Frame": "pbrs_farm.views.views:Frame",
    "Home": "pbrs_farm.scene.home:Home",
    "Model": "pbrs_farm.scene.models:Model",
    "Packing": "pbrs_farm.views.packing.packing_plan:Packing",
    "Recipe": "pbrs_farm.core.recipe:Recipe",
    "SampleRequest": "pbrs_farm.views.view_sample:SampleRequest",
    "export_views": "pbrs_farm.export.export_views:export",
    "film": "pbrs_farm.scene.pictures:film",
    "generate_model": "pbrs_farm.scene.generated_models:generate_model",
    "load": "pbrs_farm.scene.home:load",
    "make": "pbrs_farm.scene.home:make",
    "model": "pbrs_farm.scene.models:model",
    "models": "pbrs_farm.scene.models:models",
    "pack": "pbrs_farm.views.packing.pack_shards:pack",
    "open": "pbrs_farm.views.open_views:open_views",
    "render": "pbrs_farm.scene.pictures:render",
    "render_homes": "pbrs_farm.scene.pictures:render_homes",
    "stream": "pbrs_farm.commands.streaming:stream",
}

__all__ = [
    "BadHouse",
    "BadInput",
    "BadRecipe",
    "Camera",
    "Frame",
    "Home",
    "MachineFailed",
    "Model",
    "Packing",
    "PbrsError",
    "Recipe",
    "RenderFailed",
    "SampleRequest",
    "StoreFailed",
    "__version__",
    "export_views",
    "film",
    "generate_model",
    "load",
    "make",
    "model",
    "models",
    "open",
    "pack",
    "render",
    "render_homes",
    "stream",
]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        value: Any = _version()
    elif name in _PUBLIC:
        module, _, attribute = _PUBLIC[name].partition(":")
        value = getattr(import_module(module), attribute)
    else:
        raise AttributeError(f"module 'pbrs_farm' has no attribute {name!r}")
    globals()[name] = value
    return value


def _version() -> str:
    """The installed version: the git tag of the build, from the package metadata."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("pbrs-farm")
    except PackageNotFoundError:
        return "0+unknown"  # run from a folder on PYTHONPATH, not installed


def __dir__() -> list[str]:
    return sorted({*globals(), *_PUBLIC})
