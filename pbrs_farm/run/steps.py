"""The steps of a run: each reads the store, calls one stage and gives the bytes that step_cache.py writes."""

from __future__ import annotations

import functools
import platform
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any, Final

import numpy as np

import pbrs_farm
from pbrs_farm.core import keys
from pbrs_farm.core.arrays import Bools
from pbrs_farm.core.camera import Camera, Intrinsics, View
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import House
from pbrs_farm.core.layers import LAYER
from pbrs_farm.core.lighting import ALL_MODES
from pbrs_farm.core.recipe import Recipe, picture_groups
from pbrs_farm.crash_notes import note_step
from pbrs_farm.formats.cameras_json import cameras_json
from pbrs_farm.formats.layer_file import layer_bytes
from pbrs_farm.formats.marker import read_marker
from pbrs_farm.formats.radiance_exr import FILE as RADIANCE_EXR
from pbrs_farm.formats.radiance_exr import radiance_exr
from pbrs_farm.formats.serialise import json_bytes
from pbrs_farm.formats.view_json import view_description, view_json
from pbrs_farm.prepare.finished_house import finished_house
from pbrs_farm.raycast.variant import llvm_of_variant
from pbrs_farm.run import plan
from pbrs_farm.run.attributions import licences_of_view
from pbrs_farm.run.develop_step import view_histogram
from pbrs_farm.run.light_checkpoint import LightCheckpoint
from pbrs_farm.run.step_cache import (
    Outcome,
    StepOutput,
    Work,
    drop_radiance,
    required_source,
    run_unless_done,
)
from pbrs_farm.run.view_setup import ViewSetup, cached_house, marker_of_house, view_setup
from pbrs_farm.transport.scene_tables.material_rows import max_albedo

if TYPE_CHECKING:
    from pbrs_farm.selection.quality import ViewPlace
    from pbrs_farm.transport.light_result import LightResult
    from pbrs_farm.truth.optical_flow import OtherTime, Relation


def _house(work: Work) -> StepOutput:
    """house.glb, house.json, repair.json, of a dressed one dress.json: the source made ready."""
    from pbrs_farm.formats.house_bundle import bundle_from_house

    # The submitted id has the source's digest: another one means another file at that place.
    source = required_source(work)
    repaired, report, dressing = finished_house(
        source, work.recipe, work.tell_share, work.house_cache.before_edits
    )
    if repaired.id != work.house_id:
        raise BadInput(source.location, repaired.id, f"expected house {work.house_id}")
    glb, description = bundle_from_house(repaired)
    files = {"house.glb": glb, "house.json": description, "repair.json": json_bytes(report)}
    if dressing is not None:
        files[keys.DRESS] = json_bytes(dressing)
    facts: dict[str, Any] = {
        name: len(getattr(repaired, name)) for name in ("rooms", "items", "notes")
    }
    facts["note_kinds"] = dict(Counter(note.kind for note in repaired.notes))
    taken_out = Counter(r.reason for r in report.removed if r.reason in ("person", "plant"))
    if taken_out:
        facts["taken_out"] = dict(taken_out)
    if report.leaks is not None and report.leaks.n_sky:
        facts["leaks"] = [report.leaks.n_sky, report.leaks.n_rays]
    if lost := [f"{n.place}: {n.text}" for n in repaired.notes if n.kind == "wall-lost"]:
        facts["walls_lost"] = lost
    return StepOutput(files, facts)


def _cameras(work: Work) -> StepOutput:
    """cameras.json: around an object, else as the recipe's group `cameras` says."""
    from pbrs_farm.run.chosen_cameras import chosen_cameras

    cached = cached_house(work)
    house = cached.house
    seed = camera_seed(work.house_id, work.recipe)
    if keys.is_object(work.house_id):
        return _object_cameras(work, house, seed)
    sampling = chosen_cameras(house, work.recipe, seed, cached.caster)
    # Labels need other trees than the search: 80 MB.
    cached.forget_caster()
    views, report = sampling.views, sampling.report
    output = _camera_output(views, report.model_dump(mode="json"), work.recipe)
    return (
        output if views else StepOutput(output.files, {**output.facts, "why_none": report.why_none})
    )


def _object_cameras(work: Work, house: House, seed: int) -> StepOutput:
    from pbrs_farm.sample.object_cameras import object_views

    f = work.recipe.judged_cameras
    intrinsics = Intrinsics.from_hfov(f.score_width_px, f.score_height_px, f.hfov_rad)
    views = object_views(house.items[0].bounds, intrinsics, seed, (house.id,))
    return _camera_output(views, {"preset": "objects", "n_views": len(views)}, work.recipe)


def _camera_output(views: Sequence[View], report: dict[str, Any], recipe: Recipe) -> StepOutput:
    """cameras.json of views chosen through a pin-hole, with the recipe's lens applied."""
    from pbrs_farm.run.chosen_cameras import with_lens

    views = [with_lens(view, recipe.lens, recipe.rig_in_use) for view in views]
    facts = {"views": [[v.id, v.room_id, v.score] for v in views]}
    return StepOutput({"cameras.json": cameras_json(views, report)}, facts)


def camera_seed(house_id: str, recipe: Recipe) -> int:
    """The sampler's seed for a house; another light does not move a camera."""
    return keys.seed(house_id, "cameras", recipe.digest("cameras"))


def _pairs(work: Work) -> StepOutput:
    """pairs.parquet: what each pair of views of a room has in common."""
    from dataclasses import asdict

    from pbrs_farm.formats.pairs_parquet import FILE, pairs_parquet
    from pbrs_farm.truth.common_surface import pair_rows

    cached = cached_house(work)
    views = list(cached.views(work.inputs["cameras"]).values())
    rows = [asdict(row) for row in pair_rows(views, cached.caster.first_hit)]
    return StepOutput({FILE: pairs_parquet(rows)}, {"n_pairs": len(rows)})


def _tracks(work: Work) -> StepOutput:
    """tracks.npz: surface points followed through all frames of the house's film; none without frames."""
    from pbrs_farm.formats.tracks_npz import FILE, tracks_npz
    from pbrs_farm.truth.point_tracks import TrackFrame, point_tracks

    cached = cached_house(work)
    views = cached.views(work.inputs["cameras"])
    first = (view for view in views.values() if view.frame is not None and not view.shot.eye)
    film = [ViewSetup(cached, view, views) for view in sorted(first, key=_number_of_frame)]
    if not film:
        return StepOutput({}, {"n_points": 0})

    def frame(setup: ViewSetup) -> TrackFrame:
        return TrackFrame(
            setup.camera,
            setup.view.time_s or 0.0,
            lambda: setup.now.caster.hit_record(setup.camera),
            lambda: setup.now.caster.first_hit,
        )

    moving, seed = cached.moving, keys.seed(work.house_id, "tracks", work.recipe.seed)
    frames = [frame(setup) for setup in film]
    tracks = point_tracks(frames, moving.moving_faces, moving.face_motions, seed)
    file = tracks_npz(tracks, [setup.view.id for setup in film])
    return StepOutput({FILE: file}, {"n_points": len(tracks.points), "n_frames": len(film)})


def _number_of_frame(view: View) -> int:
    return view.frame or 0


def _truth(work: Work) -> StepOutput:
    """Every label of a view, and its table for view.json."""
    from pbrs_farm import truth

    # Cast one ray through each pixel's centre: all labels come from this record (rule 8).
    setup = view_setup(work)
    view, camera, now = setup.view, setup.camera, setup.now
    caster, house = now.caster, now.house
    hit = caster.hit_record(camera)
    # Derive the layers of every view, and the table of visible items.
    arrays = truth.layers_from_hit(hit, house, camera)
    table = truth.view_table(hit.item, house, camera, cut_outs=caster.cut_outs)
    if house.motions and view.time_s is not None:
        table["motion"] = truth.motion_table(house, view.time_s)
    if setup.room is not None:
        table["layout"] = truth.layout_table(setup.room, camera, hit.depth_z)
    # Add the requested layers; those behind glass cast rays again without it.
    layers = work.layers_of("truth")
    if layers:
        seed = view.shot.seed(work.house_id, "truth", work.recipe.seed, per="view")
        partners, times = _partners(setup, layers, table)
        inputs = truth.LabelInputs(
            hit,
            house,
            now.geometry,
            camera,
            lambda skip: caster.hit_record(camera, skip_faces=skip),
            setup.house.textures,
            seed,
            partners,
            caster.first_hit,
            times,
            max_albedo(work.recipe),
        )
        arrays |= truth.optional_layers(layers, inputs)
        table |= truth.optional_tables(layers, house)
    credit = house.source.attribution
    files = {LAYER[name].file: layer_bytes(name, a, credit) for name, a in arrays.items()}
    if "part" in arrays:
        files[keys.ARTICULATION] = json_bytes(
            truth.articulation_table(arrays["part"], house, camera)
        )
    # The marker remembers the layers: a run that asks for others adds to them.
    return StepOutput(files, {"table": table, **({"layers": layers} if layers else {})})


def _partners(
    setup: ViewSetup, layers: Sequence[str], table: dict[str, Any]
) -> tuple[dict[Relation, Camera], dict[Relation, OtherTime]]:
    """Cameras of the partners that the layers need, also entered into the table, and the moved houses then."""
    needed = {LAYER[name].partner for name in layers} - {""}
    if not needed:
        return {}, {}
    from pbrs_farm.truth.optical_flow import OtherTime, partner_table, partners_of

    partners = {r: v for r, v in partners_of(setup.view, setup.views).items() if r in needed}
    cameras = {relation: setup.at_size(view) for relation, view in partners.items()}
    table["partners"] = partner_table(partners, cameras)
    times: dict[Relation, OtherTime] = {}
    house, time_s = setup.house, setup.view.time_s
    for relation, view in partners.items():
        if house.house.motions and view.time_s != time_s:
            # Frames of a sequence have times.
            assert time_s is not None
            assert view.time_s is not None
            moves = house.moving.face_motions(time_s, view.time_s)
            times[relation] = OtherTime(house.at(view.time_s).caster.first_hit, *moves)
    return cameras, times


def _opengl(work: Work, mode: str) -> StepOutput:
    setup = view_setup(work)
    rasterizer = setup.house.rasterizer_at(setup.view.time_s)
    # Light by three fixed lights (OpenGL-DL) or by the lamps (OpenGL-IL).
    draw = rasterizer.render_dl if mode == "opengl_dl" else rasterizer.render_il
    rgb = draw(setup.camera)
    if keys.is_object(work.house_id):
        rgb = np.where(_missed(setup), np.uint8(0), rgb)
    png = layer_bytes(mode, rgb, setup.house.house.source.attribution)
    return StepOutput({LAYER[mode].file: png}, {"renderer": rasterizer.name})


def _missed(setup: ViewSetup) -> Bools:
    """(H, W, 1) bool: nothing is seen; of an object without context such pixels are 0."""
    return np.asarray(setup.house.caster.item_buffer(setup.camera) == 0)[..., None]


def _light(work: Work) -> StepOutput:
    """radiance.exr: both light groups (and each lamp) as linear images, with the denoiser's guides."""
    from pbrs_farm.transport.lamp_layers import layer_name

    setup = view_setup(work)
    view = setup.view
    # Resume from the checkpoint of a killed render of this step.
    unfinished = keys.unfinished_key(work.house_id, "light", view.id)
    checkpoint = LightCheckpoint(work.store, unfinished, work.digest, work.tell_share)
    layers = work.layers_of("light")
    # The seed depends on everything that changes the picture and on nothing else.
    result = setup.house.light_scene_at(view.time_s).render(
        replace(setup.camera, blur=setup.blur),
        view.room_id,
        work.recipe.light,
        setup.light_seed(view),
        checkpoint,
        pilot=setup.pilot,
        anchors=setup.anchors,
        splits_diffuse=bool(layers),
        shutter_s=work.recipe.blur.shutter_s,
    )
    # Name the images as the file does.
    images = {name: getattr(result, name) for name in ("outdoor", "indoor", "albedo", "normal")}
    images |= {layer_name(number): image for number, image in result.lamps.items()}
    images |= result.diffuse
    # Blacken what no ray hits: an object has no surroundings.
    if keys.is_object(work.house_id):
        missed = _missed(setup)
        images = {name: np.where(missed, np.float32(0), image) for name, image in images.items()}
    exr = radiance_exr(images, attribution=setup.house.house.source.attribution)
    facts = _facts_of_light(work, setup, result) | ({"layers": layers} if layers else {})
    return StepOutput({RADIANCE_EXR: exr}, facts, unfinished)


def _facts_of_light(work: Work, setup: ViewSetup, result: LightResult) -> dict[str, Any]:
    """Facts of a view's light for view.json."""
    from pbrs_farm.transport.illuminance import darkness_of_room
    from pbrs_farm.transport.light_result import darkness_of_picture

    facts = {**result.facts, "noise": result.noise}
    if result.spp:  # Metropolis counts mutations instead
        facts["spp"] = result.spp
    cached, room = setup.house, setup.room
    scene = cached.light_scene_at(setup.view.time_s)
    variant = scene.variant
    facts |= {"n_nonfinite": result.n_nonfinite, "variant": variant}
    if llvm := llvm_of_variant(variant):
        facts["llvm"] = llvm
    facts |= {"sky": cached.sky.facts()}
    # The transport knows a lamp's item, the house its name.
    items = cached.house.items
    if "lamps" in facts:
        rows = facts["lamps"]
        facts["lamps"] = [row | {"name": items[row["instance"] - 1].name} for row in rows]
    # Repeat the room's row of illuminance.json.
    dark = [darkness_of_picture(result)]
    if room is not None:
        illuminance = marker_of_house(work, "illuminance").facts
        facts["floor_lux"] = illuminance["floor_lux"].get(room.id)
        facts["warnings"] = illuminance["warnings"].get(room.id, [])
        dark += [darkness_of_room(room, facts["floor_lux"])] if facts["floor_lux"] else []
    if any(dark):
        facts["dark"] = [line for line in dark if line]
    if scene.n_lamps == 0:
        facts["note"] = "no lamps: indoor is black and mlt_il_ol equals mlt_ol"
    return facts


def _illuminance(work: Work) -> StepOutput:
    """illuminance.json: the mean illuminance of every room's floor by each light group."""
    from pbrs_farm.transport.illuminance import illuminance_record

    cached = cached_house(work)
    seed = keys.seed(work.house_id, "floor_lux", work.recipe.seed)
    lux = cached.light_scene.floor_lux(cached.house, seed=seed)
    # Give the views of a room its row through the marker's facts.
    is_day = bool(cached.sky.sun_direction[1] >= 0)
    some_lamps_off = work.recipe.emission.lamps_on < 1
    record = illuminance_record(cached.house, lux, is_day=is_day, some_lamps_off=some_lamps_off)
    warnings = {row["room"]: row["warnings"] for row in record["rooms"] if row["warnings"]}
    return StepOutput(
        {"illuminance.json": json_bytes({**record, "sky": cached.sky.facts()})},
        {"floor_lux": lux, "warnings": warnings},
    )


def _develop(work: Work) -> StepOutput:
    """The PNGs of the light modes."""
    from pbrs_farm.run.develop_step import develop_step

    return develop_step(work, lambda: view_setup(work))


def _view(work: Work) -> StepOutput:
    """view.json and histogram.json: what the other steps of the view have said and made."""
    setup = view_setup(work)
    view, facts = setup.view, _facts_of_view(work)
    digest = work.recipe.digest(*picture_groups())
    description = view_description(
        view, work.house_id, facts, recipe_digest=digest, versions=versions()
    )
    rows = description.get("instances", ())
    description |= {"licences": licences_of_view(work.store, setup.house.house, rows)}
    files = {"view.json": view_json(description)}
    # Without any picture there is nothing to select by.
    rendered = [m for m in ALL_MODES if m.value in facts or (m.groups and "develop" in facts)]
    if rendered:
        name = setup.room.name if setup.room is not None else ""
        place: ViewPlace = {
            "house": work.house_id,
            "view": view.id,
            "room": view.room_id,
            "room_type": name,
        }
        files["histogram.json"] = view_histogram(
            work.store, place, rendered, description, setup.house.house.notes, work.recipe.histogram
        )
    return StepOutput(files)


def _facts_of_view(work: Work) -> dict[str, dict[str, Any]]:
    """Step -> facts of its marker, for every done step of this view."""
    facts = {}
    for name in plan.STEPS["view"].after:
        if plan.STEPS[name].per_view:
            marker = read_marker(work.store, keys.marker_key(work.house_id, name, work.view_id))
            if marker is not None:
                facts[name] = dict(marker.facts)
    return facts


def run_step(name: str, work: Work, *, attempt: int = 1) -> Outcome:
    """Do one step unless its marker says it is done; see step_cache.run_unless_done."""
    note_step(work.source.location if work.source else work.house_id, name)
    outcome = run_unless_done(name, work, _FUNCTIONS[name], attempt=attempt)
    if name == "view" and work.drops_radiance:
        drop_radiance(work)
    return outcome


@functools.cache
def versions() -> Mapping[str, str]:
    """Versions of what makes the pictures, "-" if not installed; found once a process."""
    by_name = {"pbrs_farm": pbrs_farm.__version__, "python": platform.python_version()}
    for package in ("mitsuba", "drjit", "moderngl", "pyoidn", "numpy"):
        try:
            by_name[package] = version(package)
        except PackageNotFoundError:
            by_name[package] = "-"
    return by_name


_FUNCTIONS: Final[Mapping[str, Callable[[Work], StepOutput]]] = {
    "house": _house,
    "cameras": _cameras,
    "pairs": _pairs,
    "tracks": _tracks,
    "truth": _truth,
    "opengl_dl": partial(_opengl, mode="opengl_dl"),
    "opengl_il": partial(_opengl, mode="opengl_il"),
    "illuminance": _illuminance,
    "light": _light,
    "develop": _develop,
    "view": _view,
}
