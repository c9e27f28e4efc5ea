"""Random numbers as pure functions of (pixel, sample, dimension), hashed or scrambled Sobol, and alias tables; kernels.

No state travels with a path: dimension d of sample s of pixel p is computed when it is asked for.
Neighbouring streams of PCG32 are correlated; every number here comes out of a hash of all its
coordinates instead. An alias table samples a discrete distribution in constant time (Vose 1991). No effects.
"""

from __future__ import annotations

from typing import Any, Protocol

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32
from pbrs_farm.raycast.host_memory import with_slack

CAMERA_DIMS = 2  # dimensions of the film position
VERTEX_DIMS = 10  # of each vertex (path_step.py)


class Sampler(Protocol):
    """Uniform numbers of one path in [0, 1), each a pure function of stream, sample and dimension.

    Dimensions are assigned by hand: each decision of a vertex has its own (direct_light.py,
    path_step.py), and dim may differ between lanes. Repeated calls return the same number.
    """

    def get_1d(self, dim: Any) -> Any:
        """Float of one dimension."""
        ...

    def get_2d(self, dim: Any) -> Any:
        """Point2f of dimensions dim and dim + 1, well spread as a pair."""
        ...


class HashedSampler:
    """Independent numbers."""

    def __init__(self, key: Any, sample: Any) -> None:
        self._key = hash32(key ^ hash32(sample + 0x9E3779B9))

    def get_1d(self, dim: Any) -> Any:
        """Float of one dimension."""
        return unit_float(hash32(self._key ^ hash32(mi.UInt32(dim) + 0x85EBCA6B)))

    def get_2d(self, dim: Any) -> Any:
        """Point2f of dimensions dim and dim + 1."""
        return mi.Point2f(self.get_1d(dim), self.get_1d(mi.UInt32(dim) + 1))


class SobolSampler:
    """Owen-scrambled, index-shuffled Sobol pairs (Burley 2020): the samples of a pixel are spread
    evenly in every dimension and every pair, and their first halves and quarters are too."""

    def __init__(self, key: Any, sample: Any) -> None:
        self._key = key
        self._reversed = dr.brev(mi.UInt32(sample))

    def get_1d(self, dim: Any) -> Any:
        """Float of one dimension."""
        # Shuffle the sample's index, then scramble the digits of its van der Corput point.
        seed = hash32(self._key ^ hash32(mi.UInt32(dim) + 0x85EBCA6B))
        index = dr.brev(_laine_karras(self._reversed, seed))
        return unit_float(dr.brev(_laine_karras(index, hash32(seed + 0x68BC21EB))))

    def get_2d(self, dim: Any) -> Any:
        """Point2f of dimensions dim and dim + 1."""
        # Shuffle the index once for the pair, scramble each dimension separately.
        seed = hash32(self._key ^ hash32(mi.UInt32(dim) + 0x85EBCA6B))
        index = dr.brev(_laine_karras(self._reversed, seed))
        x = dr.brev(_laine_karras(index, hash32(seed + 0x68BC21EB)))
        y = dr.brev(_laine_karras(_pascal(index), hash32(seed + 0x02E5BE93)))
        return mi.Point2f(unit_float(x), unit_float(y))


def device_array(kind: Any, values: Any) -> Any:
    """A 1D array on the device, in memory that Dr.Jit allocated; an array already there is returned.

    An array that merely wraps NumPy's memory may be less aligned; then its packet gathers fall
    apart into single ones, and the kernel is another one each time.
    """
    if isinstance(values, kind):
        return values
    host = np.asarray(values)
    if dr.backend_v(kind) != dr.JitBackend.LLVM:
        return kind(with_slack(host))
    copy = dr.empty(kind, len(host))
    # Running kernels may still use the memory, which this process shares with them.
    dr.sync_thread()
    copy.numpy()[:] = host
    return copy


def opaque3(kind: Any, values: Any) -> Any:
    """A Point3f, Vector3f or Color3f of host values that the compiled kernel does not contain."""
    return kind(*(dr.opaque(mi.Float, float(v)) for v in values))


def stream_key(lane: Any, seed: Any) -> Any:
    """A UInt32 key of a pixel, chain or point under a seed; neighbouring keys are unrelated."""
    mixer: Any = mi.sample_tea_32
    return mixer(mi.UInt32(lane), mi.UInt32(seed), 4)[0]


def hash32(x: Any) -> Any:
    """A bijective 32-bit mixer of UInt32 (Wellons's `lowbias32`); not for cryptography."""
    x = x ^ (x >> 16)
    x = x * mi.UInt32(0x7FEB352D)
    x = x ^ (x >> 15)
    x = x * mi.UInt32(0x846CA68B)
    return x ^ (x >> 16)


def unit_float(bits: Any) -> Any:
    """Float in [0, 1) of the top 24 of 32 bits, so that no rounding gives 1."""
    return mi.Float(bits >> 8) * (1.0 / (1 << 24))


def as_random(u: Any) -> Any:
    """Clamp a reused random number to [0, 1), against rounding; NaN becomes 0, since it is no index."""
    return dr.minimum(dr.fmax(u, 0), 1 - 1e-7)


def _laine_karras(x: Any, seed: Any) -> Any:
    # Scramble a bit-reversed number uniformly, nested; constants of Vegdahl 2021.
    x = x ^ (x * mi.UInt32(0x3D20ADEA))
    x = x + seed
    x = x * ((seed >> 16) | 1)
    x = x ^ (x * mi.UInt32(0x05526C56))
    return x ^ (x * mi.UInt32(0x53A22864))


def _pascal(x: Any) -> Any:
    # Multiply by Pascal's triangle modulo 2, Sobol's second dimension, by butterflies.
    for shift, mask in (
        (16, 0xFFFF),
        (8, 0xFF00FF),
        (4, 0x0F0F0F0F),
        (2, 0x33333333),
        (1, 0x55555555),
    ):
        x = x ^ ((x >> shift) & mi.UInt32(mask))
    return x


def sample_alias_table(alias: Any, first: Any, count: Any, u: Any, active: Any) -> tuple[Any, Any]:
    """(index, u made uniform again) of an alias table's part [first, first + count).

    alias: Float, rows of `alias_rows`; several tables may lie behind each other; the index counts
    from `first`. count: at least 1.
    """
    # Choose an entry, then stay or take its alias.
    x = u * mi.Float(count)
    i = dr.minimum(mi.UInt32(x), count - 1)
    f = x - mi.Float(i)
    row = dr.gather(mi.Vector2f, alias, first + i, active)
    alternative = dr.reinterpret_array(mi.UInt32, row[1])
    stay = f < row[0]
    # Stretch the remainder of u to [0, 1).
    again = dr.select(stay, f / row[0], (f - row[0]) / (1 - row[0]))
    return dr.select(stay, i, alternative), as_random(again)


def alias_rows(weights: NDArray[np.floating]) -> F32:
    """(N, 2) rows (chance to stay, bits of the other index) of Vose's alias method.

    weights: (N,) >= 0, finite; all 0 counts as all equal. Float32: the index is stored by its bits.
    A Python loop over N, so it is for tables of up to some million entries (Vose 1991).
    """
    w = np.asarray(weights, np.float64)
    n = len(w)
    total = w.sum()
    chance = w * (n / total) if total > 0 else np.ones(n)
    stay, aliases = np.ones(n), np.arange(n, dtype=np.uint32)
    # Pair each entry below the mean with one above it, which fills it up.
    small = [int(i) for i in np.flatnonzero(chance < 1)]
    large = [int(i) for i in np.flatnonzero(chance >= 1)]
    rest = chance.tolist()
    while small and large:
        i, j = small.pop(), large[-1]
        stay[i], aliases[i] = rest[i], j
        rest[j] -= 1 - rest[i]
        if rest[j] < 1:
            small.append(large.pop())
    rows = np.empty((n, 2), np.float32)
    rows[:, 0] = np.clip(stay, 0, 1)
    rows[:, 1] = aliases.view(np.float32)
    return rows
