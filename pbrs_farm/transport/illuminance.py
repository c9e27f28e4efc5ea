"""Illuminance of a room's floor by each light group, and its record; kernels, no effects."""

from __future__ import annotations

import math
from typing import Any, Final

import drjit as dr
import mitsuba as mi
import numpy as np
import shapely

from pbrs_farm.core.arrays import F64, I64
from pbrs_farm.core.frames import LM_PER_W, LUMINANCE
from pbrs_farm.core.house import House, Room
from pbrs_farm.core.recipe import LightFields
from pbrs_farm.geometry.plan_surfaces import room_shape
from pbrs_farm.transport.kernels.device_scene import DeviceScene
from pbrs_farm.transport.kernels.direct_light import Strategy, sample_direct_light
from pbrs_farm.transport.kernels.emitters import Emitters
from pbrs_farm.transport.kernels.path_state import (
    ALL_EMITTERS,
    NO_EMITTERS,
    EmitterFilter,
    PathContext,
    device_fields,
    surface_path,
    white_vertex,
)
from pbrs_farm.transport.kernels.path_step import advance
from pbrs_farm.transport.kernels.sampler import SobolSampler, device_array, stream_key

LAMPS_LX: Final = (30.0, 1000.0)  # expected mean by lamps (docs/formats/view_json.md)
DAYLIGHT_LX: Final = (20.0, 5000.0)  # and by daylight; a value outside is a warning

DARK_LX: Final = 1.0  # a room with less by all light is dark: full moonlight is 0.3 lx

_SPP: Final = 32  # paths a point
_ABOVE_FLOOR_M: Final = 0.05  # above carpets
_MAX_ATTEMPTS: Final = 200  # attempts to find a point in a polygon thin in its box


def illuminance_record(
    house: House,
    lux: dict[str, dict[str, float]],
    *,
    is_day: bool = True,
    some_lamps_off: bool = False,
) -> dict[str, Any]:
    """illuminance.json: a row per room in lux (of LightScene.floor_lux), with warnings for implausible values."""
    known = {"is_day": is_day, "some_lamps_off": some_lamps_off}
    rows = [
        {
            "room": room.id,
            "name": room.name,
            "lit_by": list(room.lit_by),
            "outdoor_lx": lux[room.id]["outdoor"],
            "indoor_lx": lux[room.id]["indoor"],
            "warnings": photometric_warnings(room, lux[room.id], **known),
        }
        for room in house.rooms
        if room.id in lux
    ]
    return {"rooms": rows, "expected_lx": {"outdoor": DAYLIGHT_LX, "indoor": LAMPS_LX}}


def photometric_warnings(
    room: Room, lux: dict[str, float], *, is_day: bool = True, some_lamps_off: bool = False
) -> list[str]:
    """A line for each light group ("outdoor", "indoor") whose illuminance of the floor is out of range.

    some_lamps_off: the recipe has a share of the lamps off, so a room may lack indoor light.
    """
    lines = []
    has_lamps = not {"lamps", "fallback", "added"}.isdisjoint(room.lit_by) and not some_lamps_off
    has_daylight = is_day and not {"windows", "sky"}.isdisjoint(room.lit_by)
    for group, is_expected, (low, high) in (
        ("outdoor", has_daylight, DAYLIGHT_LX),
        ("indoor", has_lamps, LAMPS_LX),
    ):
        value = lux[group]
        if (is_expected and value < low) or value > high:
            text = f"room {room.id}: {group} light gives {value:g} lx on the floor"
            lines.append(f"{text}, expected {low:g} to {high:g}")
    dark = darkness_of_room(room, lux)
    return [*lines, dark] if dark else lines


def darkness_of_room(room: Room, lux: dict[str, float]) -> str:
    """Warning if all light (group -> mean lx of the floor) leaves it darker than DARK_LX, else ""."""
    total = sum(lux.values())
    if total >= DARK_LX:
        return ""
    return f"room {room.id}: {total:.2g} lx on the floor by all light, less than {DARK_LX:g}"


def floor_points(room: Room, n: int, seed: int) -> F64:
    """(n, 3) points uniform over a room's floor polygon by seed, 5 cm above it, furniture disregarded."""
    # Draw points in the polygon's box and keep those inside, until there are enough.
    rng = np.random.default_rng(seed)
    low, high = room.polygon.min(0), room.polygon.max(0)
    shape = room_shape(room)
    inside: list[F64] = []
    for _attempt in range(_MAX_ATTEMPTS):
        tried = low + (high - low) * rng.random((4 * n, 2))
        inside.append(tried[shapely.contains_xy(shape, tried[:, 0], tried[:, 1])])
        if sum(len(k) for k in inside) >= n:
            break
    plan = np.concatenate([*inside, np.repeat(room.polygon.mean(0)[None], n, 0)])[:n]
    return np.stack([plan[:, 0], np.full(n, room.floor_y + _ABOVE_FLOOR_M), plan[:, 1]], 1)


def illuminance_lx(
    scene: DeviceScene, emitters: Emitters, points: F64, seed: int
) -> tuple[float, float]:
    """(outdoor, indoor) mean lx of level surfaces at points (N, 3), facing up; few samples a point, by seed."""
    up = np.tile([0.0, 1.0, 0.0], (len(points), 1))
    # A white matte surface reflects E / pi: times pi and lm/W it is illuminance.
    radiance = radiosity(scene, emitters, points, up, _SPP, seed)
    lumens = [float((v @ LUMINANCE).mean()) * LM_PER_W * math.pi for v in radiance]
    return lumens[0], lumens[1]


def radiosity(
    scene: DeviceScene,
    emitters: Emitters,
    points: F64,
    normals: F64,
    spp: int,
    seed: int,
    *,
    lamps: I64 | None = None,
    max_depth: int | None = None,
) -> tuple[F64, F64]:
    """(outdoor, indoor) irradiance
    pi, (N, 3) each; lamps: (N,) the one that counts, nothing outdoors then.
    """
    # Let one lamp through for each point when lamps are given, all emitters otherwise.
    n = len(points)
    indoor = np.full(n, ALL_EMITTERS) if lamps is None else lamps
    outdoor = np.full(n, ALL_EMITTERS if lamps is None else NO_EMITTERS)
    counted = EmitterFilter(
        *(device_array(mi.Int32, v.astype(np.int32)) for v in (indoor, outdoor))
    )
    context = PathContext(
        scene, emitters, device_fields(LightFields(), max_depth=max_depth), counted
    )
    # Give each point a separate random stream.
    key = stream_key(dr.arange(mi.UInt32, n), dr.opaque(mi.UInt32, seed & 0xFFFFFFFF))
    p, normal = mi.Point3f(*_columns(points)), mi.Vector3f(*_columns(normals))
    sums = _radiosity(context, p, normal, key, dr.opaque(mi.UInt32, spp))
    dr.eval(*sums)
    outdoor_sum, indoor_sum = (v.numpy().T.astype(np.float64) / spp for v in sums)
    return outdoor_sum, indoor_sum


def _columns(rows: F64) -> list[Any]:
    return [device_array(mi.Float, rows[:, k].astype(np.float32)) for k in range(3)]


@dr.syntax
def _radiosity(context: PathContext, p: Any, normal: Any, key: Any, spp: Any) -> tuple[Any, Any]:
    """Sums over spp samples of (outdoor, indoor) radiance reflected by a white surface."""
    outdoor, indoor = mi.Color3f(0), mi.Color3f(0)
    s = mi.UInt32(0)
    # Constants are excluded from the state of the loops, or Dr.Jit traces their code twice.
    while dr.hint(s < spp, exclude=[context, p, normal, key, spp]):
        # Add direct light at the point.
        sampler = SobolSampler(key, s)
        counted = context.emitter_filter.indoor
        near = context.emitters.near_lamps(p, normal, counted, mi.Bool(True))
        vertex = white_vertex(p, normal, near)
        direct = sample_direct_light(context, sampler, vertex, Strategy(), mi.Bool(True))
        l_out, l_in = direct.outdoor.light, direct.indoor.light
        # Sample the hemisphere by the cosine and follow the path.
        wo = mi.warp.square_to_cosine_hemisphere(sampler.get_2d(vertex.dim + 1))
        path = surface_path(vertex, mi.Vector3f(vertex.frame.to_world(wo)), wo.z * dr.inv_pi)
        active = mi.Bool(True)
        while dr.hint(active, exclude=[context, sampler]):
            path, result, alive = advance(context, sampler, path, active)
            l_out += dr.select(active, result.emitted_outdoor + result.direct_outdoor, 0)
            l_in += dr.select(active, result.emitted_indoor + result.direct_indoor, 0)
            active = active & alive
        outdoor += l_out
        indoor += l_in
        s += 1
    return outdoor, indoor
