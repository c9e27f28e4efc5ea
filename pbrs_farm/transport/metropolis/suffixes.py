"""Suffixes of paths, recorded as reconnection.py shows them to other pixels; kernels, no effects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import drjit as dr
import mitsuba as mi

from pbrs_farm.transport.kernels.packets import rgb, xyz
from pbrs_farm.transport.kernels.path_state import (
    DirectionPdfs,
    EmitterFilter,
    PathState,
    StepResult,
)

SUFFIX_FLOATS: Final = 36
SUFFIX_PACKETS: Final = SUFFIX_FLOATS // 4
MAX_SHARED_PDF: Final = 4.0  # 1 / m2; by a matte surface, 0.28 m straight before it
# Columns of a suffix written one by one; record_suffix lists the others.
# At the end _PDFS holds the share of p2 drawn by the surface, _GUIDED_PDF the rest of p2.
_PDFS, _ARRIVING, _EMITTER_Z, _OWN_LIGHT, _GUIDED_PDF = 3, 28, 31, 32, 35


@dataclass
class SplitPath:
    """A path under way, split at its second vertex into prefix and suffix."""

    path: PathState  # beyond the second vertex its throughput is the suffix's own
    light: mi.Color3f  # of paths that end at the second vertex or before
    prefix_beta: mi.Color3f  # throughput up to the second vertex
    suffix_light: mi.Color3f  # from beyond, the prefix's throughput not counted
    is_straight: mi.Bool  # the first vertex is rough; since, only glass and cut-outs were passed
    passed: mi.Float  # probability of having passed those
    first: DirectionPdfs  # of leaving the first vertex
    second: DirectionPdfs
    suffix_weight: mi.Float  # of the ray that left the second vertex, by how it was guided
    shared: mi.Float  # share of the light that its suffix shows to other pixels


def no_direction() -> DirectionPdfs:
    """Before there is a vertex."""
    return DirectionPdfs(mi.Float(0), mi.Float(1), mi.Float(0))


class SuffixRecords(NamedTuple):
    """Suffixes as chains had them at the ends of rounds, row = round * chains + chain."""

    rows: Any  # (records * SUFFIX_FLOATS,)
    pixel: Any  # UInt32
    shared: Any  # share of the light reconnected to other pixels
    is_shared: Any  # Bool: any of it
    n_chains: Any  # UInt32, opaque


def no_records(n_rounds: int, n_chains: int) -> SuffixRecords:
    """Room for the suffixes of as many rounds."""
    n = n_rounds * n_chains
    return SuffixRecords(
        dr.empty(mi.Float, n * SUFFIX_FLOATS),
        dr.empty(mi.UInt32, n),
        dr.empty(mi.Float, n),
        dr.empty(mi.Bool, n),
        dr.opaque(mi.UInt32, n_chains),
    )


def record_suffix(
    suffix: Any,
    result: StepResult,
    path: PathState,
    reach: tuple[DirectionPdfs, Any],
    emitter_filter: EmitterFilter,
    active: Any,
) -> Any:
    """Record, in local memory, the second vertex of a path just after it was made.

    The share of its light to reconnect. path: as it was when it set out from the first vertex, or
    from the last sheet of glass on the way; reach: how the first vertex was left, and the
    probability of having passed those sheets.
    """
    si, bsdf, d = result.si, result.si.bsdf, result.scattered_d
    direct = result.outdoor_sample if emitter_filter.indoor is None else result.indoor_sample
    # Convert to K's measure: by the pdf of x2 by all techniques, and the probability of the glass
    # between. That of leaving x2 is known only where the ray ends.
    rest, passed = reach
    cos = dr.abs(dr.dot(si.ng, path.d))
    distance2 = dr.squared_norm(si.p - path.reference.p)
    measure = cos / distance2
    pdfs = rest.techniques / dr.maximum(result.guided_weight, 1e-30) * measure * passed
    values = (
        *xyz(si.p),
        pdfs,
        *xyz(si.n_interpolated),
        bsdf.alpha,
        *xyz(si.ng),
        d.x,
        *rgb(bsdf.kd),
        d.y,
        *rgb(bsdf.f0),
        d.z,
        *rgb(bsdf.tau),
        direct.d.x,
        *rgb(direct.incident),
        direct.d.y,
    )
    for k, value in enumerate(values):
        suffix.write(value, mi.UInt32(k), active)
    suffix.write(direct.d.z, mi.UInt32(_EMITTER_Z), active)
    return shared_share(rest.bsdf * measure)


def shared_share(area_pdf: Any) -> Any:
    """Share of the light between two vertices to reconnect: small if they are close."""
    return MAX_SHARED_PDF / dr.maximum(area_pdf, MAX_SHARED_PDF)


def finish_suffix(suffix: Any, light: Any, split: SplitPath, active: Any) -> None:
    """Add the data known at a path's end: its light, the light at x2 from x3 (T), p2's parts."""
    # Find the pdf of leaving x2: share * bsdf + guided; of a ray that missed its target, 1.
    second, weight = split.second, split.suffix_weight
    is_known = weight > 0
    pdf = dr.select(is_known, second.techniques / dr.maximum(weight, 1e-30), 1)
    share = dr.select(is_known, second.share, 0)
    guided = dr.maximum(pdf - share * second.bsdf, 0)
    arriving = dr.select(is_known, split.suffix_light, 0)
    direct = light * (suffix.read(mi.UInt32(_PDFS), active) * pdf)
    for c in range(3):
        suffix.write(arriving[c], mi.UInt32(_ARRIVING + c), active)
        suffix.write(direct[c], mi.UInt32(_OWN_LIGHT + c), active)
    suffix.write(share, mi.UInt32(_PDFS), active)
    suffix.write(guided, mi.UInt32(_GUIDED_PDF), active)
