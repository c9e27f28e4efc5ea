"""The user's own mesh files as models, one or many, checked when named. Effects: reads files."""

from __future__ import annotations

import glob
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.checked_calls import Positive, checked_call, warn_caller
from pbrs_farm.core.classes import NYU40_NAMES, OTHERPROP
from pbrs_farm.core.edits import ModelRef
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import Note
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.core.shown_text import hint_of_choice
from pbrs_farm.read.common.furniture_classes import nyu40_of
from pbrs_farm.read.objects.own_model import SUFFIXES, ModelShape, companions_digest, model_shape
from pbrs_farm.regular_files import MAX_SCENE_BYTES, read_given

UNITS: Final = {"m": 1.0, "cm": 0.01, "mm": 0.001, "inch": 0.0254}
_UP: Final = {
    # Columns: directions of the model's x, y and z axes when upright, y up.
    "y": np.eye(3),
    "z": np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]]),
    "x": np.array([[0.0, -1.0, 0], [1.0, 0, 0], [0, 0, 1.0]]),
}


@dataclass(frozen=True, slots=True)
class Model:
    """A mesh that homes can hold many instances of; pose them with `Home.place` and `Home.scatter`.

    >>> pf.model("can.ply", category="bottle")
    <Model can: ...
    """

    ref: ModelRef
    up: str = "y"  # the file's up axis

    @property
    def id(self) -> str:
        """Prefix of the names of its instances in tables and poses.

        >>> can.id
        'can'
        """
        return self.ref.id

    @property
    def shape(self) -> ModelShape:
        """Surfaces, materials and pictures in the model's frame, metres; read once per process.

        >>> np.ptp(can.shape.bounds, axis=0).shape
        (3,)
        """
        return model_shape(self.ref, ReadFields())

    @property
    def size_m(self) -> tuple[float, float, float]:
        """Extent along the x, y and z axes of the model's frame.

        >>> round(can.size_m[2], 3)
        0.11
        """
        x, y, z = np.ptp(self.shape.bounds, axis=0)
        return float(x), float(y), float(z)

    @property
    def upright(self) -> F64:
        """(3, 3) rotation from the model's axes to a world with y up.

        >>> (can.upright @ (0, 0, 1)).tolist()
        [0.0, 1.0, 0.0]
        """
        return _UP[self.up]

    @property
    def notes(self) -> tuple[Note, ...]:
        """Missing or guessed parts of its file, as in `notes` of house.json.

        >>> can.notes
        ()
        """
        return self.shape.notes

    def __repr__(self) -> str:
        size = " x ".join(f"{v:.3g}" for v in self.size_m)
        return f"<Model {self.id}: {NYU40_NAMES[self.ref.nyu40]}, {size} m>"


@checked_call
def model(
    path: str | Path,
    *,
    category: str = "",
    size_m: Positive | None = None,
    unit: str = "m",
    up: str = "",
    name: str = "",
    credit: str = "",
) -> Model:
    """Load a mesh file as a model to place in homes.

    path: a .glb, .gltf, .obj, .ply, .stl or .off file. category: its kind in a word ("cup"); the
    NYU40 class follows from it, else from the file's name. size_m: its longest side in metres,
    whatever its unit; else unit: m, cm, mm or inch per unit of the file. up: the axis that points up,
    x, y or z; y for glTF and OBJ, z for the others. credit: a line that pictures must carry.

    Raises BadInput, naming the file, if the mesh is missing, empty, not finite or 900 m large. Missing
    or guessed parts, such as a picture, are a warning and in `notes` of the model and of homes.

        >>> pf.model("can.ply", category="bottle", size_m=0.2).size_m[2]
        0.2...
    """
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES:
        raise BadInput(path, "", "is not a supported mesh format", hint=f"of {', '.join(SUFFIXES)}")
    if unit not in UNITS:
        raise BadInput("unit", unit, "no such unit", hint=hint_of_choice(unit, tuple(UNITS)))
    up = up or ("y" if path.suffix.lower() in (".glb", ".gltf", ".obj") else "z")
    if up not in _UP:
        raise BadInput("up", up, "no such axis", hint="of x, y, z")
    data = read_given(path, MAX_SCENE_BYTES)
    label = nyu40_of("", category) or nyu40_of("", path.stem) or OTHERPROP
    ref = ModelRef(
        path=str(path.resolve()),
        sha256=keys.sha256(data),
        companions=companions_digest(path.resolve()),
        id=name or keys.slug(path.stem),
        category=category or path.stem,
        nyu40=label,
        scale=UNITS[unit],
        credit=credit,
    )
    if size_m is not None:
        ref = ref.model_copy(update={"scale": 1e-3})  # makes any unit small enough to read
        extent = float(np.ptp(model_shape(ref, ReadFields()).bounds, axis=0).max())
        ref = ref.model_copy(update={"scale": 1e-3 * size_m / extent})
    loaded = Model(ref, up)
    # Read the file now, so that a bad one raises here and not in a run.
    if notes := loaded.notes:
        # Show one note per kind: an unread map must not hide a missing picture.
        firsts = list({note.kind: note for note in reversed(notes)}.values())[::-1]
        more = f"; and {len(notes) - len(firsts)} more: model.notes" if notes[len(firsts) :] else ""
        text = "; ".join(f"{note.place}: {note.text} ({note.kind})" for note in firsts)
        warn_caller(f"{path.parent}/{text}{more}")
    return loaded


@checked_call
def models(pattern: str | Path, **options: object) -> list[Model]:
    """Load the models of a pattern or folder, in order of name; options as of `model`.

        >>> [thing.id for thing in pf.models("*.ply")]
        ['can']

    Raises BadInput if no file matches or a file cannot be read.
    """
    text = str(pattern)
    if Path(text).is_dir():
        files = sorted(p for p in Path(text).rglob("*") if p.suffix.lower() in SUFFIXES)
    elif Path(text).is_file():
        files = [Path(text)]  # a name may contain [ and *
    else:
        files = sorted(Path(p) for p in glob.glob(text, recursive=True))  # noqa: PTH207
    if not files:
        raise BadInput(pattern, "", "no model found", hint=f"of {', '.join(SUFFIXES)}")
    names = _names(files)
    return [model(path, name=name, **options) for path, name in zip(files, names, strict=True)]  # type: ignore[arg-type]


def _names(paths: list[Path]) -> list[str]:
    """A unique name per file: its stem, prefixed with the folder if the stem is not unique."""
    stems = Counter(keys.slug(path.stem) for path in paths)
    names: list[str] = []
    for path in paths:
        # Folders of scans often use one file name: prefix the folder.
        alone = stems[keys.slug(path.stem)] == 1
        name = keys.slug(path.stem if alone else f"{path.parent.name} {path.stem}")
        n = names.count(name) + sum(taken.startswith(f"{name}-x") for taken in names)
        names.append(f"{name}-x{n + 1}" if n else name)
    return names
