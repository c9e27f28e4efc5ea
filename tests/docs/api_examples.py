"""The public Python names, and the examples in their docstrings. Effects: runs examples on request."""

from __future__ import annotations

import doctest
import functools
import inspect
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any, Final

import pbrs_farm as pf

# Classes whose values the package's functions return.
_RETURNED: Final = (
    "pbrs_farm.scene.home:Rooms", "pbrs_farm.scene.home:Items",
    "pbrs_farm.scene.viewpoints:Viewpoint", "pbrs_farm.scene.viewpoints:Viewpoints",
    "pbrs_farm.views.views:Views",
)  # fmt: skip
_MEMBERS: Final = (property, functools.cached_property, staticmethod, classmethod)
_OF_NO_HOME: Final = (
    "BadHouse", "BadInput", "BadRecipe", "Camera", "MachineFailed", "PbrsError", "Recipe", "RenderFailed",
    "StoreFailed",
)  # fmt: skip


def public_names() -> dict[str, Any]:
    """Name -> object: all of `pbrs_farm`, and each public method or property of its classes."""
    objects = {name: getattr(pf, name) for name in pf.__all__ if name != "__version__"}
    for place in _RETURNED:
        module, _, name = place.partition(":")
        objects[name] = getattr(import_module(module), name)
    for owner, value in list(objects.items()):
        for name, member in vars(value).items() if inspect.isclass(value) else ():
            is_one = isinstance(member, _MEMBERS) or inspect.isfunction(member)
            # Pydantic's methods do not count.
            if is_one and not name.startswith(("_", "model_")):
                objects[f"{owner}.{name}"] = member
    return objects


def example_of(name: str, named: Any) -> doctest.DocTest | None:
    """The example in the docstring of a name; None without one."""
    named = getattr(named, "__func__", named)
    text = (getattr(named, "__doc__", None) or "") if named is not None else ""
    example = doctest.DocTestParser().get_doctest(inspect.cleandoc(text), {}, name, None, 0)
    return example if example.examples else None


def needs_home(name: str) -> bool:
    """True if an example uses a home, which takes seconds to make."""
    return name.partition(".")[0] not in _OF_NO_HOME


def fault_of(example: doctest.DocTest, names: dict[str, Any]) -> str:
    """Difference between an example's output and the shown one; "" if they are equal."""
    example.globs = dict(names)
    outputs: list[str] = []
    flags = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    runner = doctest.DocTestRunner(verbose=False, optionflags=flags)
    runner.run(example, out=outputs.append, clear_globs=False)
    return "".join(outputs)


def names_of_no_home() -> dict[str, Any]:
    """Names available to the examples of cameras and recipes."""
    import numpy as np

    from pbrs_farm.core.camera import Camera, intrinsics_from_k
    from pbrs_farm.core.recipe import recipe_from_name

    return {
        "pf": pf, "np": np, "Camera": Camera, "intrinsics_from_k": intrinsics_from_k,
        "recipe_from_name": recipe_from_name,
    }  # fmt: skip


def names_of_home(folder: Path) -> dict[str, Any]:
    """Names available to all other examples: one home, one tiny frame; its files are written into the folder."""
    import numpy as np
    import trimesh
    from PIL import Image

    from pbrs_farm.views.view_sample import SampleRequest

    trimesh.creation.cylinder(radius=0.035, height=0.11).export(folder / "can.ply")
    Image.new("RGB", (64, 64), (130, 90, 60)).save(folder / "wood.png")
    (folder / "mine.csv").write_text("from,id,name\nchair,1,seat\nwall,2,shell\n")
    # A sky is read when it is first rendered; here it is only named.
    (folder / "panorama.hdr").write_bytes(b"")
    home = pf.load("builtin", recipe="preview")
    camera = pf.Camera.look_at((4.4, 1.5, 3.4), (1.5, 0.5, 1.0), size=(64, 48))
    views = pf.render(home, [camera], modes=["opengl_dl"])
    return {
        "pf": pf, "np": np, "home": home, "camera": camera, "views": views, "frame": views[0],
        "can": pf.model(folder / "can.ply", category="bottle"), "SampleRequest": SampleRequest,
    }  # fmt: skip


def faults(folder: Path, *, of_homes: bool) -> Iterator[tuple[str, str]]:
    """(name, fault) of each example of one kind, run in the folder, which is the current one."""
    names = names_of_home(folder) if of_homes else names_of_no_home()
    for name, named in public_names().items():
        example = example_of(name, named)
        if example is not None and needs_home(name) == of_homes:
            yield name, fault_of(example, names)
