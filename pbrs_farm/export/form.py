"""The type of a form of export, and the table of all forms: the modules of `forms/` and plugins.

Effects: a form's module is imported at its first use. `python -m pbrs_farm.export.form` prints the
tables of docs/formats/export.md.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Final, TypeAlias

from pbrs_farm.core.entries import EntryTable
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.options import flag, options_of, record_of
from pbrs_farm.core.record import Record
from pbrs_farm.core.shown_text import did_you_mean, hint_of_choice

if TYPE_CHECKING:
    from pbrs_farm.export.chosen_view import Choice, ChosenView
    from pbrs_farm.export.home_pieces import ExportedHome

LEFT_OUT: Final = "left_out.txt"
LICENCES: Final = "licences.txt"
"""A file of an export: the licences of all that its views show, a line each."""
REMARKS: Final = "remarks.txt"
"""A file of an export whose lines are shown to its user."""
FORMS: Final = EntryTable("pbrs_farm.export.forms", "FORM", "exports", ("ViewForm", "HomeForm"))

WriteViews: TypeAlias = "Callable[[list[ChosenView], Path, Choice], None]"
WriteHome: TypeAlias = "Callable[[ExportedHome, Path], None]"


@dataclass(frozen=True, slots=True)
class Convention:
    """Pixel origin, axes and depth of a form: a row of the table in docs/formats/export.md.

    first_pixel: x and y of the first pixel's centre in K and in pixel coordinates: 0.5 as in view.json,
    0 for readers that count from the centre; None for a form with neither. axes: of poses, normals and points. depth: its
    unit and direction; "" for no depth.
    """

    first_pixel: float | None
    axes: str
    depth: str = ""

    @property
    def row(self) -> str:
        """The cells of its row, joined."""
        centre = self.first_pixel
        pixel = "-" if centre is None else f"({centre:g}, {centre:g})"
        return " | ".join((pixel, self.axes or "-", self.depth or "-"))


@dataclass(frozen=True, slots=True)
class Takes:
    """The views that a form takes; left_out.txt names the others.

    of: those of a list that it takes. left_out: why the others are not exported, "" = they are not named; the
    command prints those whose reason begins with "has no". none, hint: the error if it takes none.
    """

    of: Callable[[list[ChosenView]], list[ChosenView]]
    left_out: str
    none: str
    hint: str


def with_parts(parts: str, *layers: str, hint: str) -> Takes:
    """Views with a picture and layers; parts: the layers in words."""

    def of(views: list[ChosenView]) -> list[ChosenView]:
        return [v for v in views if v.picture is not None and all(map(v.has, layers))]

    return Takes(of, f"has no picture or no {parts}", f"no view has a picture and {parts}", hint)


PICTURES: Final = Takes(
    lambda views: [view for view in views if view.picture is not None],
    "has no picture", "no view has a picture", "run with --modes",
)  # fmt: skip
"""Views with a picture."""


def frames_with(options: str, *, of_rigs: bool = True) -> Takes:
    """Frames of sequences, which `pbrs-farm run HOME <options>` makes; of_rigs: those of all cameras of a rig."""

    def of(views: list[ChosenView]) -> list[ChosenView]:
        frames = [view for view in views if view.facts.get("frame") is not None]
        return [view for view in frames if of_rigs or not view.shot.eye]

    left = "no frame of a sequence" if of_rigs else "not a film frame of the rig's first camera"
    none = "no view is a frame of a sequence"
    return Takes(of, f"is {left}", none, f"pbrs-farm run HOME {options}")


@dataclass(frozen=True, slots=True)
class ViewForm:
    """A form of finished views, written by `pbrs-farm export --to NAME`.

    A module `forms/<name>.py` ends with one, its dashes written `_`; a plugin's entry point names
    one. The choices of --to, messages and docs/formats/export.md read the table; `READ_BACK` of
    tests/export/test_form.py names the test that reads the form back.

        FORM = ViewForm("words", write_words, "`words.tsv`: a line of words a view", options=WordOptions)

    name: of --to. write: called with the exported views, an empty folder and the Choice; it raises
    BadInput for views that the form cannot hold. `content.each_view` makes one of a function that gives the
    files of a view. With --split it is called once for each of train, val and test. help: the files, in
    Markdown. options: a Record whose fields are options (`core/options.py`), None for a form without. The
    command line, `Views.export` and the tables of a set's file take them from there; write reads them as
    `choice.of(WordOptions)`. has_classes: True if user-defined classes can replace NYU40's. finish: called
    once after all splits with the whole folder, the names of the splits (() without) and the Choice.
    convention: None if the form defines no pixels, axes or depth. lenses: lens models that it can describe
    beside the pin-hole, () for any; a view through another is an error. layers: a view needs one of them, if
    any are named. is_of_frames: True if its views are the frames of sequences. reads_radiance: True if it
    writes less for views without radiance.exr. takes: the views that write is called with, None for all.
    """

    of: ClassVar[str] = "views"

    name: str
    write: WriteViews
    help: str
    options: type[Record] | None = None
    has_classes: bool = False
    finish: Callable[[Path, tuple[str, ...], Choice], None] | None = None
    convention: Convention | None = None
    lenses: tuple[str, ...] = ()
    layers: tuple[str, ...] = ()
    is_of_frames: bool = False
    reads_radiance: bool = False
    takes: Takes | None = None


@dataclass(frozen=True, slots=True)
class HomeForm:
    """A form of homes, as scenes of other simulators; listed like a ViewForm.

    write: called with each home and its own empty folder. options: as of a ViewForm; write reads them as
    `home.of(MyOptions)`. remark: a warning for each written home, "" for none. up: the up axis in the
    frames of its bodies, "y" or "z", for the grasps.json beside them; "" for no grasps.json.
    """

    of: ClassVar[str] = "homes"

    name: str
    write: WriteHome
    help: str
    options: type[Record] | None = None
    remark: str = ""
    up: str = ""


Form: TypeAlias = ViewForm | HomeForm


def form_names() -> tuple[str, ...]:
    """The forms by name, those of plugins last; imports none of them.

    >>> {"coco", "yolo-seg", "gltf"} <= set(form_names())
    True
    """
    return FORMS.names()


def form_of(name: str) -> Form:
    """The form of that name; for an unknown name BadInput, with a list of all forms.

    Raises MachineFailed if a plugin's entry point names no form of its name.

        >>> form_of("coco").has_classes
        True
    """
    names = form_names()
    if name not in names:
        raise BadInput("--to", name, "no such format", hint=hint_of_choice(name, names))
    form: Form = FORMS.entry(name)
    return form


def all_forms() -> Iterator[Form]:
    """Every form.

    Slow, since all are imported: for messages and completion, not to check one name.
    """
    return map(form_of, form_names())


def form_options(form: Form) -> dict[str, str]:
    """Name of each option of a form -> its help; {} for a form without options.

    >>> list(form_options(form_of("lidar")))
    ['scanner']
    """
    if form.options is None:
        return {}
    return {
        name: form.options.model_fields[field].description or ""
        for name, (field, _shown) in options_of(form.options).items()
    }


def options_from(form: Form, values: Mapping[str, Any]) -> Record | None:
    """The form's options with these values, defaults for the others; None for a form without options.

    Raises BadInput for a value that does not fit, and for an option that the form does not have; it
    names the forms that have it.
    """
    for name in values:
        if name not in form_options(form):
            raise no_such_option(form, name)
    return None if form.options is None else record_of(values, form.options)


def no_such_option(form: Form, name: str) -> BadInput:
    """The error for an option that a form does not have; its hint names the forms that have it."""
    owners = [owner.name for owner in all_forms() if name in form_options(owner)]
    hint = f"--to {', '.join(owners)}" if owners else did_you_mean(name, form_options(form))
    return BadInput(flag(name), "", f"{form.name} has no such option", hint=hint)


def forms_table(of: str) -> str:
    """The package's forms of "views", or of "homes", as a Markdown table."""
    rows = ["| form | files |", "|---|---|"]
    forms = map(form_of, FORMS.own_names())
    rows += [f"| `{form.name}` | {form.help} |" for form in forms if form.of == of]
    return "\n".join(rows)


def conventions_table() -> str:
    """The conventions of the package's forms of views, as a Markdown table."""
    rows = ["| form | centre of the first pixel | axes | depth |", "|---|---|---|---|"]
    for name in FORMS.own_names():
        convention = getattr(form_of(name), "convention", None)
        if convention is not None:
            rows.append(f"| `{name}` | {convention.row} |")
    return "\n".join(rows)


if __name__ == "__main__":
    tables = (forms_table("views"), conventions_table(), forms_table("homes"))
    sys.stdout.write("\n\n".join(tables) + "\n")
