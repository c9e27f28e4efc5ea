"""Viewpoints: cameras chosen by a home's sampler or by the user; no effects."""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final, overload

import numpy as np

from pbrs_farm.core import keys
from pbrs_farm.core.camera import Camera, View
from pbrs_farm.core.errors import PbrsError
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import CameraFields, LensFields, RigFields
from pbrs_farm.core.shot import Shot, view_id
from pbrs_farm.core.table import Table
from pbrs_farm.gallery.notebook_html import MOST_SHOWN, figure_html
from pbrs_farm.run.chosen_cameras import with_lens
from pbrs_farm.sample.camera_report import CameraReport
from pbrs_farm.sample.house_sampler import add_rig_views
from pbrs_farm.sample.stored_cameras import OUTSIDE, room_of, sector_of

if TYPE_CHECKING:
    from pbrs_farm.scene.home import Home

_SKETCH_PX: Final = 160  # longer edge of a small picture, pixels


@dataclass(frozen=True, slots=True, eq=False)
class Viewpoint:
    """A camera in a home, and how it was chosen."""

    view: View
    chosen_by: CameraFields | None = None  # None: chosen by the user

    @property
    def id(self) -> str:
        """`<room>_<sector>` and a number where a sector has several.

        >>> home.viewpoint(camera).id == frame.ref.view
        True
        """
        return self.view.id

    @property
    def camera(self) -> Camera:
        """Its pose and intrinsics.

        >>> home.viewpoint(camera).camera is camera
        True
        """
        return self.view.camera

    @property
    def room(self) -> str:
        """The id of its room; "out" outside all.

        >>> home.viewpoint(camera).room == frame.room
        True
        """
        return self.view.room_id

    def __repr__(self) -> str:
        x, y, z = self.camera.eye
        return f"<Viewpoint {self.id} at ({x:.2f}, {y:.2f}, {z:.2f}), score {self.view.score:.3g}>"


class Viewpoints(Sequence[Viewpoint]):
    """The viewpoints of a home, and the report on rejected ones."""

    def __init__(
        self,
        viewpoints: Sequence[Viewpoint],
        report: CameraReport | None = None,
        home: Home | None = None,
    ) -> None:
        """home: the home of the viewpoints; if given, a notebook shows sketches of the views."""
        self._viewpoints = tuple(viewpoints)
        self.report = report
        self.home = home

    @overload
    def __getitem__(self, at: int) -> Viewpoint: ...
    @overload
    def __getitem__(self, at: slice) -> Viewpoints: ...
    def __getitem__(self, at: int | slice) -> Viewpoint | Viewpoints:
        if isinstance(at, slice):
            return Viewpoints(self._viewpoints[at], self.report, self.home)
        return self._viewpoints[at]

    def __len__(self) -> int:
        return len(self._viewpoints)

    @property
    def table(self) -> Table:
        """A row a viewpoint: id, room, eye, score, objects in sight.

        >>> len(home.cameras(n=2).table)
        2
        """
        rows: list[dict[str, Any]] = [
            {
                "id": viewpoint.id,
                "room": viewpoint.room,
                "eye": [round(float(v), 2) for v in viewpoint.camera.eye],
                "score": viewpoint.view.score,
                "objects": len(viewpoint.view.objects),
            }
            for viewpoint in self
        ]
        return Table(("id", "room", "eye", "score", "objects"), rows)

    def __repr__(self) -> str:
        return repr(self.table)

    def _repr_html_(self) -> str:
        """The home's plan with them on it, and small pictures of at most MOST_SHOWN."""
        if self.home is None or not self:
            return self.table._repr_html_()
        some = self._viewpoints[:MOST_SHOWN]
        try:
            pictures = self.home.sketches(some, _SKETCH_PX)
            cells = "".join(
                figure_html(_caption(viewpoint), rgb, _SKETCH_PX)
                for viewpoint, rgb in zip(some, pictures, strict=True)
            )
        except PbrsError as error:
            # Without a renderer, show the error below the plan.
            cells = f"<p>{html.escape(str(error))}</p>"
        n_more = len(self) - len(some)
        more = f"<p>... and {n_more} more</p>" if n_more else ""
        return f"<div>{self.home.plan(self)}<br>{cells}{more}</div>"


def _caption(view: Viewpoint) -> str:
    return view.id if view.chosen_by is None else f"{view.id}, score {view.view.score:.3g}"


def viewpoint_of(camera: Camera, house: House, fields: CameraFields) -> Viewpoint:
    """The user's camera as a viewpoint of a house; its id names its room and its own numbers."""
    room = room_of(house, camera)
    room_id, sector = room.id if room else OUTSIDE, sector_of(camera, fields.n_sectors)
    i = camera.intrinsics
    numbers = [*np.asarray(camera.world_from_camera).ravel().tolist(), i.fx, i.fy, i.cx, i.cy]
    mark = keys.digest(numbers, i.width_px, i.height_px, i.lens.table())[:8]
    view = View(f"{view_id(room_id, sector)}_{mark}", room_id, sector, camera, "given")
    return Viewpoint(view)


def film_viewpoints(
    cameras: Sequence[Viewpoint], fps: float, from_s: float = 0.0
) -> list[Viewpoint]:
    """Viewpoints in sequence as the frames of a film, fps a second, the first at from_s."""
    return [
        Viewpoint(
            replace(
                viewpoint.view,
                id=Shot.of_frame(k).id,
                origin="given",
                score=0.0,
                objects={},
                frame=k,
                time_s=from_s + k / fps,
                rig=None,
            )
        )
        for k, viewpoint in enumerate(cameras)
    ]


def rig_viewpoints(frames: Sequence[Viewpoint], rig: RigFields | None) -> list[Viewpoint]:
    """The viewpoints of each rig camera for each frame; unchanged without a rig."""
    views = add_rig_views([frame.view for frame in frames], rig)
    return [Viewpoint(with_lens(view, LensFields(), rig)) for view in views]
