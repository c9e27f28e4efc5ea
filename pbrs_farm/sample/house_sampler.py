"""Camera sampling of a house by the paper's rule (section 3.1); no effects.

The counter, an argument, renders the pictures that the rule needs: pixels of each item in each camera.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from pbrs_farm.core.camera import RigPlace, View
from pbrs_farm.core.frames import OPENCV_FROM_OPENGL
from pbrs_farm.core.house import House, geometry_from_house
from pbrs_farm.core.recipe import CameraFields, RigFields
from pbrs_farm.core.rig_fields import RigCamera
from pbrs_farm.sample.camera_report import CameraReport, RoomReport, total_rejected
from pbrs_farm.sample.camera_source import Sampling
from pbrs_farm.sample.eye_probes import ItemCounter
from pbrs_farm.sample.photo_choice import RoomCandidates
from pbrs_farm.sample.photo_sampler import PhotoSampler, room_report
from pbrs_farm.sample.room_sampler import RoomSampler, RoomTrace
from pbrs_farm.sample.view_overlap import ItemPictures


def sample_cameras(
    house: House,
    fields: CameraFields,
    seed: int,
    counter: ItemCounter,
    pictures_of: ItemPictures | None = None,
) -> Sampling:
    """The best view of each sector of each room that something lights (paper section 3.1).

    counter: pixels of each item of this house in each camera, panes included. pictures_of: depth and
    items of cameras, which the preset photo asks for (ValueError without). The same house,
    fields and seed give the same views, whatever the counter's speed and the rooms' order.
    Views have the scoring size (640x480) and are in order of rooms and sectors; with the preset
    released in order of falling score, as published.
    """
    geometry = geometry_from_house(house)
    if fields.preset == "photo":
        if pictures_of is None:
            raise ValueError("the preset photo needs pictures_of")
        photographer = PhotoSampler(house, fields, seed, counter, pictures_of, geometry)
        return _photographed(photographer)
    # Sample room by room, each with separate random numbers.
    views: list[View] = []
    rooms: list[RoomReport] = []
    traces: list[RoomTrace] = []
    for room in house.rooms:
        sampler = RoomSampler(house, room, fields, seed, counter, geometry)
        # Report a room that cannot be sampled with its reason.
        reason = sampler.explain_rejection()
        if reason:
            rooms.append(RoomReport(room_id=room.id, name=room.name, reason=reason))
            continue
        room_views, report, trace = sampler.run()
        views += room_views
        rooms.append(report)
        traces.append(trace)
    if fields.preset == "released":
        views.sort(key=lambda view: -view.score)
    return Sampling(tuple(views), _camera_report(fields, views, tuple(rooms)), tuple(traces))


def _photographed(sampler: PhotoSampler) -> Sampling:
    """The views of the preset photo: all rooms' candidates are scored before any is chosen."""
    house, fields = sampler.house, sampler.fields
    # Score the candidates of all rooms.
    reports: dict[str, RoomReport] = {}
    scored: list[RoomCandidates] = []
    for room in house.rooms:
        rules = RoomSampler(house, room, fields, sampler.seed, sampler.counter, sampler.geometry)
        reason = rules.explain_rejection()
        if reason:
            reports[room.id] = RoomReport(room_id=room.id, name=room.name, reason=reason)
        else:
            scored.append(sampler.room_candidates(room))
    scored = sampler.with_better_scores(scored)
    # Choose among all of them, so that of two near-duplicates the better one stays.
    chosen = sampler.choose(scored)
    views: list[View] = []
    for of_room in scored:
        room_views, reports[of_room.room.id] = room_report(sampler, of_room, chosen)
        views += room_views
    traces = tuple(RoomTrace(s.room.id, s.candidates, s.verdict) for s in scored)
    return Sampling(
        tuple(views),
        _camera_report(fields, views, tuple(reports[r.id] for r in house.rooms)),
        traces,
    )


def _camera_report(
    fields: CameraFields, views: list[View], rooms: tuple[RoomReport, ...]
) -> CameraReport:
    return CameraReport(
        preset=fields.preset,
        source=fields.source,
        n_views=len(views),
        n_candidates=sum(s.n_candidates for room in rooms for s in room.sectors),
        refused=total_rejected(rooms),
        rooms=rooms,
    )


def add_rig_views(views: Iterable[View], rig: RigFields | None) -> tuple[View, ...]:
    """The views of all cameras of a rig (the first keeps the id) for each view; unchanged without a rig."""
    if rig is None:
        return tuple(views)
    cameras = tuple(zip(rig.eyes, rig.cameras, strict=True))
    return tuple(_rig_view(view, rig, *camera) for view in views for camera in cameras)


def _rig_view(view: View, rig: RigFields, eye: str, camera: RigCamera) -> View:
    # Both frames turn from OpenCV's axes, which the rig has, to OpenGL's.
    moved = OPENCV_FROM_OPENGL @ camera.rig_from_camera @ OPENCV_FROM_OPENGL
    return replace(
        view,
        id=view.shot.partner(eye=eye).id,
        camera=replace(view.camera, world_from_camera=view.camera.world_from_camera @ moved),
        rig=RigPlace(rig.name, camera.name, view.id, camera.rig_from_camera),
    )
