"""Frames of a root, of memory or of shards, to choose from and to read one by one. Effects: reads lazily."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Protocol, overload

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.checked_calls import Size, checked_call
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import Item
from pbrs_farm.core.house_split import SPLITS, SplitShares
from pbrs_farm.core.layers import MOST_VARIANTS
from pbrs_farm.core.shown_text import did_you_mean
from pbrs_farm.core.table import Table
from pbrs_farm.formats.class_map import ClassMap, class_map
from pbrs_farm.views.stored_layers import ViewFacts
from pbrs_farm.views.view_sample import MODES, Sample, SampleRequest


@dataclass(frozen=True, slots=True, order=True)
class ViewRef:
    """Names a view of a root."""

    house: str
    view: str

    @property
    def id(self) -> str:
        """`<house>/<view>`, as in Sample.id."""
        return f"{self.house}/{self.view}"

    @property
    def is_object(self) -> bool:
        """True for a single model without context, False for a view of a house."""
        return self.house.startswith("object_")


class ViewSource(Protocol):
    """A source of views: an output root in a store, or shards. Can be sent to a process."""

    @property
    def url(self) -> str:
        """The URL of the source."""
        ...

    def lacks(self, ref: ViewRef, request: SampleRequest) -> str:
        """The first requested file missing from the view; "" if it has all."""
        ...

    def modes(self, ref: ViewRef) -> tuple[str, ...]:
        """The lighting modes of the view's pictures."""
        ...

    def facts(self, ref: ViewRef) -> ViewFacts:
        """The view's camera; raises BadInput if it cannot be read."""
        ...

    def table(self, ref: ViewRef) -> dict[str, Any]:
        """The stored view.json (docs/formats/view_json.md); for shards, the packed part."""
        ...

    def read(self, ref: ViewRef, request: SampleRequest) -> Sample:
        """The requested arrays; raises BadInput if one is missing, damaged or of the wrong type."""
        ...

    def layers(self, ref: ViewRef) -> tuple[str, ...]:
        """The view's layers, by the names of core/layers.py; for shards, the packed ones."""
        ...

    def layer(self, ref: ViewRef, name: str) -> NDArray[Any]:
        """A layer as stored; raises BadInput if the view lacks it."""
        ...

    def kept_by(self, run: str) -> frozenset[ViewRef]:
        """The views that a selection keeps; raises BadInput if there is no such run."""
        ...

    def split_of(self, ref: ViewRef, shares: SplitShares | None) -> str:
        """The split of the view's house; shares None: as packed, else 80/10/10."""
        ...

    def save(self, refs: Sequence[ViewRef], place: str | Path) -> None:
        """Write views in the layout of an output root; raises BadInput if the source is not one."""
        ...


@dataclass(frozen=True, slots=True)
class Frame:
    """One view: pictures, labels and the camera, read when they are asked for.

    The same whether `pbrs_farm.render` made it just now or `pbrs_farm.open` found it in a folder, a
    bucket or shards. Arrays are (H, W) or (H, W, C); pixel (row 0, column 0) is top left.

        >>> frame = pf.render(home, camera, modes=["opengl_dl"])
        >>> frame.colour.shape, frame.depth.shape
        ((48, 64, 3), (48, 64))
    """

    ref: ViewRef
    source: ViewSource

    @property
    def id(self) -> str:
        """`<house>/<view>`.

        >>> frame.id == f"{home.id}/{frame.ref.view}"
        True
        """
        return self.ref.id

    @property
    def modes(self) -> tuple[str, ...]:
        """The lighting modes of its pictures.

        >>> frame.modes
        ('opengl_dl',)
        """
        return self.source.modes(self.ref)

    @property
    def room(self) -> str:
        """The id of its room.

        >>> frame.room in {room.id for room in home.house.rooms}
        True
        """
        return self.source.facts(self.ref).room

    @property
    def size(self) -> tuple[int, int]:
        """Width and height as stored, pixels.

        >>> frame.size
        (64, 48)
        """
        return self.source.facts(self.ref).size

    @property
    def k(self) -> NDArray[np.float64]:
        """(3, 3): (x right, y down, z forward) to pixels.

        >>> frame.k[:2, 2].tolist()
        [32.0, 24.0]
        """
        return np.array(self.source.facts(self.ref).K, np.float64)

    @property
    def world_from_camera_opencv(self) -> NDArray[np.float64]:
        """(4, 4) pose: metres, world y up, camera x right, y down, z forward.

        >>> np.allclose(frame.world_from_camera_opencv[:3, 3], camera.eye)
        True
        """
        return np.array(self.source.facts(self.ref).world_from_camera_opencv, np.float64)

    @property
    def table(self) -> dict[str, Any]:
        """view.json: instances with their boxes and classes, sky, seeds (docs/formats/view_json.md).

        >>> len(frame.table["instances"]) == len(frame.instances)
        True
        """
        return self.source.table(self.ref)

    @property
    def layers(self) -> tuple[str, ...]:
        """All layers it has, optional ones too; pbrs_farm.core.layers.LAYER says unit and axes of each.

        >>> {"depth", "normal", "instance"} <= set(frame.layers)
        True
        """
        return self.source.layers(self.ref)

    @checked_call
    def layer(self, name: str) -> NDArray[Any]:
        """A layer as stored, (H, W) or (H, W, C): "depth" in mm, "position" in metres, ...

        >>> frame.layer("depth").dtype
        dtype('uint16')
        """
        return self.source.layer(self.ref, name)

    @property
    def colour(self) -> NDArray[np.uint8]:
        """(H, W, 3) sRGB of the best available mode: mlt_il_ol, else mlt_ol, else an OpenGL mode.

        >>> frame.colour.shape, frame.colour.dtype
        ((48, 64, 3), dtype('uint8'))
        """
        if not self.modes:
            raise BadInput(self.source.url, self.id, "no picture in any mode")
        return self.picture(next(mode for mode in reversed(MODES) if mode in self.modes))

    @checked_call
    def picture(self, mode: str) -> NDArray[np.uint8]:
        """(H, W, 3) sRGB in a lighting mode; BadInput for one that was not rendered.

        >>> (frame.picture("opengl_dl") == frame.colour).all()
        np.True_
        """
        if mode not in self.modes:
            hint = f"of {', '.join(self.modes) or 'none'}"
            raise BadInput(self.source.url, self.id, f"no picture in {mode}", hint=hint)
        return np.asarray(self._array("colour", mode), np.uint8)

    @property
    def variants(self) -> tuple[NDArray[np.uint8], ...]:
        """The same view by other cameras, (H, W, 3) sRGB each: recipe `tone.variants` (docs/light.md).

        Empty where none were asked for. `table["modes"]["develop"]["variants"]` says which camera
        took each.

            >>> len(frame.variants)
            0
        """
        names = [f"mlt_il_ol.{n}" for n in range(1, MOST_VARIANTS + 1)]
        return tuple(self.layer(name) for name in names if name in self.layers)

    @property
    def depth(self) -> NDArray[np.float32]:
        """(H, W) metres along the optical axis; 0 = nothing.

        >>> 0 < frame.depth.max() < 20
        np.True_
        """
        return np.asarray(self._array("depth"), np.float32)

    @property
    def normal(self) -> NDArray[np.float32]:
        """(H, W, 3) unit, camera axes x right, y down, z forward; 0 = nothing.

        >>> np.allclose(np.linalg.norm(frame.normal[24, 32]), 1, atol=0.01)
        True
        """
        return np.asarray(self._array("normal"), np.float32)

    @property
    def classes(self) -> NDArray[np.uint8]:
        """(H, W) NYU40 class; 0 = none.

        >>> set(np.unique(frame.classes)) <= set(range(41))
        True
        """
        return np.asarray(self._array("class40"), np.uint8)

    @checked_call
    def classes_by(self, table: str | Path | ClassMap) -> NDArray[np.uint16]:
        """(H, W) user-defined classes, 0 = none: a CSV file with columns from,id,name (docs/formats/export.md).

        Raises BadInput for an invalid table, naming its line, and for a frame of shards, which has no table
        of instances.

            >>> set(np.unique(frame.classes_by("mine.csv"))) <= {0, 1, 2}
            True
        """
        return class_map(table).label(self.instance, self._instance_rows())

    @property
    def instance(self) -> NDArray[np.uint16]:
        """(H, W) instance id, as in `instances`; 0 = nothing.

        >>> set(np.unique(frame.instance)) - {0} <= {row["id"] for row in frame.instances}
        True
        """
        return np.asarray(self._array("instance"), np.uint16)

    @property
    def instances(self) -> Table:
        """The visible instances, one row each: class, pixels, boxes, and the pose of placed models.

        >>> sum(row["pixels"] for row in frame.instances) <= 48 * 64
        True
        """
        columns = ("id", "name", "class", "pixels", "visible_fraction", "truncated", "box2d")
        return Table(columns, self._instance_rows())

    @checked_call
    def mask(self, thing: str | int | Item) -> NDArray[np.bool_]:
        """(H, W) bool mask of the visible pixels of one or several items.

        thing: an item, its id ("mug 1") or the id of a row of `instances`; or a name or class, for instance
        "chair*": all that match. Raises BadInput if no match is in sight.

            >>> frame.mask(frame.instances[0]["item"]).sum() == frame.instances[0]["pixels"]
            np.True_
        """
        rows = self._instance_rows()
        if isinstance(thing, str):
            rows_found = _rows_named(rows, thing)
        elif isinstance(thing, Item):
            rows_found = [row for row in rows if row["item"] == thing.id]
        else:
            rows_found = [row for row in rows if row["id"] == thing]
        if not rows_found:
            word = thing.id if isinstance(thing, Item) else str(thing)
            words = dict.fromkeys(row[key] for row in rows for key in ("item", "name", "class"))
            raise BadInput(self.id, word, "is not in sight", hint=did_you_mean(word, words))
        return np.isin(self.instance, [row["id"] for row in rows_found])

    def _instance_rows(self) -> list[dict[str, Any]]:
        rows: list[dict[str, Any]] | None = self.table.get("instances")
        if rows is None:
            hint = "open the output folder itself"
            raise BadInput(self.source.url, self.id, "has no table of instances", hint=hint)
        return rows

    @property
    def warnings(self) -> tuple[str, ...]:
        """Recoverable problems: a dark room, a camera in no room.

        >>> frame.warnings
        ()
        """
        return tuple(self.table.get("warnings", ()))

    def _array(self, name: str, mode: str | None = None) -> NDArray[Any]:
        mode = mode or (self.modes or (MODES[0],))[0]
        sample = self.source.read(self.ref, SampleRequest((name,), mode))
        array: NDArray[Any] = getattr(sample, name)
        return array

    @checked_call
    def save(self, place: str | Path) -> None:
        """Write the frame into a folder or s3://bucket/prefix, byte for byte as `run` does.

        Frames of several homes and cameras may share a place as long as they share a recipe.
        Raises BadRecipe where the place holds another recipe, BadInput for a frame of shards.

            >>> frame.save("one")
            >>> pf.open("one")[0].id == frame.id
            True
        """
        self.source.save([self.ref], place)

    @checked_call
    def export(self, out: str | Path, to: str = "coco", **choice: Any) -> Path:
        """Write the frame in a form that other tools read, as Views.export.

        >>> frame.export("one_coco", to="coco").is_dir()
        True
        """
        return Views(self.source, (self.ref,), {}).export(out, to, **choice)

    def questions(self) -> list[dict[str, Any]]:
        """Questions about space with their answers, as Views.questions.

        >>> {"question", "ground_truth", "options"} <= set(frame.questions()[0])
        True
        """
        return Views(self.source, (self.ref,), {}).questions()

    def __repr__(self) -> str:
        width, height = self.size
        return f"<Frame {self.id} {width}x{height}: {', '.join(self.layers)}>"

    def _repr_html_(self) -> str:
        from pbrs_farm.gallery.notebook_html import frame_html

        return frame_html(self)

    @checked_call
    def sample(self, request: SampleRequest | None = None) -> Sample:
        """The arrays of a request: colour in mlt_il_ol light and normals in OpenCV's axes for None.

        >>> frame.sample(SampleRequest(("depth",), "opengl_dl")).depth.shape
        (48, 64)
        """
        return self.source.read(self.ref, request or SampleRequest())


@dataclass(frozen=True, slots=True)
class Views(Sequence[Frame]):
    """Frames of one source, in the order of their ids.

    left_out: id -> reason, for views that `only` had to omit.

        >>> views = pf.render(home, [camera], modes=[])
        >>> len(views)
        1
    """

    source: ViewSource
    refs: tuple[ViewRef, ...]
    left_out: dict[str, str]

    @overload
    def __getitem__(self, at: int) -> Frame: ...
    @overload
    def __getitem__(self, at: slice) -> Views: ...
    def __getitem__(self, at: int | slice) -> Frame | Views:
        if isinstance(at, slice):
            return replace(self, refs=self.refs[at])
        return Frame(self.refs[at], self.source)

    def __len__(self) -> int:
        return len(self.refs)

    def __iter__(self) -> Iterator[Frame]:
        return (Frame(ref, self.source) for ref in self.refs)

    @checked_call
    def save(self, place: str | Path) -> None:
        """Write all of them into one place, as Frame.save.

        >>> views.save("all")
        >>> len(pf.open("all"))
        1
        """
        self.source.save(self.refs, place)

    @checked_call
    def export(
        self,
        out: str | Path,
        to: str = "coco",
        *,
        layers: str | Sequence[str] | None = None,
        modes: str | Sequence[str] | None = None,
        size: Size | None = None,
        classes: str | Path | None = None,
        shares: SplitShares | None = None,
        **options: Any,
    ) -> Path:
        """Write the frames into the new folder out in a form of other tools; returns out.

        to: coco, yolo, kitti, bop and the other forms of views of docs/formats/export.md. layers and modes: one
        or several, None = all; size: (width, height), None = as rendered; classes: a CSV file of user-defined
        classes; shares: a folder a split. options: of the form, as `scanner="vlp16"` of lidar. Raises BadInput
        for an unknown form or option, views that the form cannot hold, an out that is not empty, and frames of
        shards.

            >>> sorted(path.name for path in views.export("coco", to="coco").iterdir())[:1]
            ['annotations.json']
        """
        from pbrs_farm.export.export_views import export_frames

        return export_frames(
            self,
            Path(out),
            to,
            layers=layers,
            modes=modes,
            size=size,
            classes=classes,
            shares=shares,
            **options,
        )

    def questions(self) -> list[dict[str, Any]]:
        """Questions about space: a dict with question_type, question, ground_truth, options, instances.

        The kinds and columns are those of VSI-Bench (docs/formats/export.md, form `questions`). The frames of a
        walk are asked about as one film, all other frames separately; a frame with too few items has no
        questions. Raises BadInput for frames of shards.

            >>> [row["question_type"] for row in views.questions()][:1]
            ['object_counting']
        """
        from pbrs_farm.export.export_views import questions_of

        return questions_of(self)

    def __repr__(self) -> str:
        return f"<{len(self)} frames of {len(self.homes)} homes in {self.source.url}>"

    def _repr_html_(self) -> str:
        from pbrs_farm.gallery.notebook_html import views_html

        return views_html(self)

    @property
    def homes(self) -> tuple[str, ...]:
        """The ids of the views' houses (and objects without context).

        >>> views.homes == (home.id,)
        True
        """
        return tuple(dict.fromkeys(ref.house for ref in self.refs))

    @property
    def modes(self) -> tuple[str, ...]:
        """The lighting modes of at least one view.

        >>> views.modes
        ('opengl_dl',)
        """
        return tuple(dict.fromkeys(m for ref in self.refs for m in self.source.modes(ref)))

    @checked_call
    def only(
        self,
        *,
        split: str | None = None,
        shares: SplitShares | None = None,
        houses: Collection[str] | None = None,
        objects: bool | None = None,
        selection: str | None = None,
        request: SampleRequest | None = None,
    ) -> Views:
        """The views of a split, of some houses, of rooms or of objects, with all that request needs.

        selection: only what that run of `pbrs-farm select` keeps. A view that lacks a file of request (a run goes on, or was made without that mode) is left
        out and named in left_out. Raises BadInput where none is left.

            >>> len(views.only(houses=[home.id]))
            1
        """
        if split is not None and split not in SPLITS:
            raise BadInput("split", split, "no such split", hint=f"of {', '.join(SPLITS)}")
        chosen = None if selection is None else self.source.kept_by(selection)
        refs = [
            ref
            for ref in self.refs
            if (chosen is None or ref in chosen)
            and (houses is None or ref.house in houses)
            and (objects is None or ref.is_object == objects)
            and (split is None or self.source.split_of(ref, shares) == split)
        ]
        lacking = {r.id: self.source.lacks(r, request) for r in refs} if request else {}
        left_out = {view: f"no {file}" for view, file in lacking.items() if file}
        complete = tuple(ref for ref in refs if ref.id not in left_out)
        if not complete:
            raise BadInput(self.source.url, "", _nothing_left(split, len(refs), left_out))
        return replace(self, refs=complete, left_out=left_out)


def _rows_named(rows: Sequence[Mapping[str, Any]], pattern: str) -> list[Mapping[str, Any]]:
    """The rows whose item has an id, else a name or a class, that matches; case counts first."""
    for keys, fold in ((("item",), str), (("name", "class"), str), (("name", "class"), str.lower)):
        matches = [
            row
            for row in rows
            if any(
                word == fold(pattern) or fnmatchcase(word, fold(pattern))
                for word in (fold(str(row[key])) for key in keys)
            )
        ]
        if matches:
            return matches
    return []


def _nothing_left(split: str | None, n_found: int, left_out: dict[str, str]) -> str:
    where = f" in split {split}" if split else ""
    if not left_out:
        return f"no view{where}"
    view, why = next(iter(left_out.items()))
    return f"none of {n_found} views{where} has the requested layers: {view}: {why}"
