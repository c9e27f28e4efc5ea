"""A path under way that is split at its second vertex, so that its suffix can be reconnected; no effects."""

from __future__ import annotations

from dataclasses import dataclass

import mitsuba as mi

from pbrs_farm.transport.kernels.path_state import DirectionPdfs, PathState


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
