"""What a form of export is, and the table of all forms: the modules of `forms/` and plugins.

Effects: a form's module is imported when it is first asked for. The table of
docs/formats/export.md is printed from it (`python -m pbrs_farm.export.form`).
"""

from __future__ import annotations

import pkgutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Final, TypeAlias

from pbrs_farm.core.errors import BadInput, MachineFailed
from pbrs_farm.core.plugins import plugins
from pbrs_farm.export import forms

if TYPE_CHECKING:
    from pbrs_farm.export.chosen_view import Choice, ChosenView
    from pbrs_farm.export.home_pieces import ExportedHome

LEFT_OUT: Final = "left_out.txt"
REMARKS: Final = "remarks.txt"
"""A file of an export whose lines its user is told."""
_GROUP: Final = "exports"  # of plugins

WriteViews: TypeAlias = "Callable[[list[ChosenView], Path, Choice], int]"
WriteHome: TypeAlias = "Callable[[ExportedHome, Path], int]"


@dataclass(frozen=True, slots=True)
class Convention:
    """How a form counts pixels and points its axes: a row of the table in docs/formats/export.md.

    first_pixel: where the centre of the first pixel lies in K and in pixel coordinates, along x and
    along y: 0.5 as in view.json, 0 of forms whose readers count from it; None of a form with neither.
    has_k: whether K, or focal lengths and principal point, stand in the form's files. axes: of poses,
    normals and points. depth: its unit, and along what; "" for none.
    """

    first_pixel: float | None
    has_k: bool
    axes: str
    depth: str = ""

    @property
    def row(self) -> str:
        """Its cells."""
        at = self.first_pixel
        k = "as view.json" if at == 0.5 else f"cx, cy less {0.5 - (at or 0):g}"
        pixel = "-" if at is None else f"({at:g}, {at:g})"
        return " | ".join((pixel, k if self.has_k else "-", self.axes or "-", self.depth or "-"))


@dataclass(frozen=True, slots=True)
class ViewForm:
    """A form of finished views: what `pbrs-farm export --to NAME` writes of them.

    A module `forms/<name>.py` ends with one, its dashes written `_`; a plugin's entry point names
    one. Nothing else lists forms: the choices of --to, messages and docs/formats/export.md read the table.

        FORM = ViewForm("words", write_words, "`words.tsv`: a line of words a view")

    name: of --to. write: called with the views that are exported, an empty folder and the Choice;
    it returns the number of files it wrote, and raises BadInput for views that it cannot hold. With
    --split it is called once for each of train, val and test. help: what is written, in Markdown.
    has_classes: whether classes of a user's own can stand in for NYU40's. finish: called once after
    all splits with the whole folder, the names of the splits (() without) and the Choice; returns
    the number of files it added. convention: None where a form says nothing of its own.
    """

    of: ClassVar[str] = "views"

    name: str
    write: WriteViews
    help: str
    has_classes: bool = False
    finish: Callable[[Path, tuple[str, ...], Choice], int] | None = None
    convention: Convention | None = None


@dataclass(frozen=True, slots=True)
class HomeForm:
    """A form of homes, as scenes of other simulators; it is listed as a ViewForm is.

    write: called with each home and its own empty folder; returns the number of files. remark: what
    a user should know of each home that was written, "" for nothing. up: the axis that is up in the
    frames of its bodies, "y" or "z", so that a grasps.json can be written beside them; "" for none.
    """

    of: ClassVar[str] = "homes"

    name: str
    write: WriteHome
    help: str
    remark: str = ""
    up: str = ""


Form: TypeAlias = ViewForm | HomeForm


def form_names() -> tuple[str, ...]:
    """The forms by name, those of plugins last; imports none of them.

    >>> {"coco", "yolo-seg", "gltf"} <= set(form_names())
    True
    """
    own = sorted(module.name.replace("_", "-") for module in pkgutil.iter_modules(forms.__path__))
    return (*own, *(name for name in plugins(_GROUP) if name not in own))


def form_of(name: str) -> Form:
    """The form of that name; BadInput, naming those there are, for an unknown one.

    Raises MachineFailed where a plugin's entry point names no form of its name.

        >>> form_of("coco").has_classes
        True
    """
    known = form_names()
    if name not in known:
        raise BadInput("--to", name, "no such form", hint=f"of {', '.join(known)}")
    if name in {module.name.replace("_", "-") for module in pkgutil.iter_modules(forms.__path__)}:
        form: Form = import_module(f"{forms.__name__}.{name.replace('-', '_')}").FORM
        return form
    plugin = plugins(_GROUP)[name]
    loaded = plugin.load()
    if not isinstance(loaded, ViewForm | HomeForm) or loaded.name != name:
        raise MachineFailed(f"plugin {plugin.mark} is no ViewForm or HomeForm called {name}")
    return loaded


def forms_with_classes() -> tuple[str, ...]:
    """The forms that can hold classes of a user's own; imports them all.

    Slow, since every form is imported: for messages and completion, not to check one name.
    """
    found = (form_of(name) for name in form_names())
    return tuple(form.name for form in found if isinstance(form, ViewForm) and form.has_classes)


def forms_table(of: str) -> str:
    """The package's forms of "views", or of "homes", as a Markdown table."""
    rows = ["| form | what is written |", "|---|---|"]
    own = (form_of(name) for name in form_names() if name not in plugins(_GROUP))
    rows += [f"| `{form.name}` | {form.help} |" for form in own if form.of == of]
    return "\n".join(rows)


def conventions_table() -> str:
    """How the package's forms of views count pixels, point axes and measure depth, in Markdown."""
    rows = ["| form | centre of the first pixel | K | axes | depth |", "|---|---|---|---|---|"]
    for name in form_names():
        convention = getattr(form_of(name), "convention", None)
        if convention is not None and name not in plugins(_GROUP):
            rows.append(f"| `{name}` | {convention.row} |")
    return "\n".join(rows)


def name_left_out(out: Path, views: list[ChosenView], why: str) -> int:
    """Write left_out.txt, `<house>/<view>: <why>` a line, where there are views; the number of files.

    why: begins with "has no".
    """
    if not views:
        return 0
    lines = [f"{view.house.id}/{view.id}: {why}\n" for view in views]
    (out / LEFT_OUT).write_text("".join(lines), "utf-8")
    return 1


if __name__ == "__main__":
    tables = (forms_table("views"), conventions_table(), forms_table("homes"))
    sys.stdout.write("\n\n".join(tables) + "\n")
