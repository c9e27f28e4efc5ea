"""The reflectance model is reciprocal, conserves energy and is sampled with its stated pdf."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

from pbrs_farm.raycast.variant import choose_variant, mitsuba

pytestmark = pytest.mark.skipif(
    choose_variant().startswith("scalar"), reason="the kernels need LLVM or CUDA"
)

N = 1 << 18


def bsdf(kd: float, f0: float, alpha: float, tau: float = 0.0) -> Any:
    mi = mitsuba()
    from pbrs_farm.transport.kernels.bsdf import Bsdf

    return Bsdf(mi.Color3f(kd), mi.Color3f(f0), mi.Color3f(tau), mi.Float(alpha), mi.UInt32(0))


def direction(theta: float, phi: float = 0.3) -> Any:
    mi = mitsuba()
    s = np.sin(theta)
    return mi.Vector3f(float(s * np.cos(phi)), float(s * np.sin(phi)), float(np.cos(theta)))


def uniform_pairs(n: int, seed: int) -> Any:
    mi = mitsuba()
    u = np.random.default_rng(seed).random((2, n), np.float32)
    return mi.Point2f(u[0], u[1])


MODELS = [(0.9, 0.0, 0.0, 0.0), (0.9, 0.04, 0.1, 0.0), (0.9, 1.0, 0.3, 0.0), (0.0, 0.9, 0.05, 0.0), (0.5, 0.0, 0.0, 0.45)]  # fmt: skip
ANGLES = [0.0, 0.7, 1.2, 1.5]


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("theta", ANGLES)
def test_no_more_light_leaves_than_arrives(model: tuple[float, ...], theta: float) -> None:
    mi = mitsuba()
    from pbrs_farm.transport.kernels.bsdf import evaluate_bsdf, sample_bsdf

    m, wi = bsdf(*model), direction(theta)
    lobes = mi.Float(np.random.default_rng(1).random(N, np.float32))
    value, pdf = evaluate_bsdf(m, wi, sample_bsdf(m, wi, lobes, uniform_pairs(N, 2)))
    weight = (value[0] / pdf).numpy()
    weight = np.where(np.isfinite(weight), weight, 0)
    # 1.01: the diffuse and the specular part of a coat are matched at every angle to 1 %.
    assert weight.mean() < 1.01
    if model[1:] == (0.0, 0.0, 0.0):
        assert weight.mean() == pytest.approx(model[0], rel=1e-4)


@pytest.mark.quick(8)
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("theta", ANGLES)
def test_samples_follow_the_pdf_they_name(model: tuple[float, ...], theta: float) -> None:
    # The integral of g over the sphere by the sampler equals that by uniform directions.
    mi = mitsuba()
    from pbrs_farm.transport.kernels.bsdf import evaluate_bsdf, sample_bsdf

    m, wi = bsdf(*model), direction(theta)
    lobes = mi.Float(np.random.default_rng(3).random(N, np.float32))
    drawn = sample_bsdf(m, wi, lobes, uniform_pairs(N, 4))
    uniform = mi.warp.square_to_uniform_sphere(uniform_pairs(8 * N, 5))
    _value, pdf = evaluate_bsdf(m, wi, uniform)
    weight = pdf.numpy().astype(np.float64) * 4 * np.pi
    # A coat's sample below the horizon is discarded: pdf 0, light lost.
    is_real = evaluate_bsdf(m, wi, drawn)[1].numpy() > 0
    d, u = drawn.numpy(), uniform.numpy()
    for axis, power in itertools.product(range(3), (1, 2)):
        ours = (d[axis].astype(np.float64) ** power * is_real).mean()
        plain = (u[axis].astype(np.float64) ** power * weight).mean()
        spread = (u[axis] ** power * weight).std() / np.sqrt(8 * N) + 1 / np.sqrt(N)
        assert abs(ours - plain) < 6 * spread


@pytest.mark.parametrize("model", MODELS[:4])
def test_swapping_the_directions_gives_the_same_reflectance(model: tuple[float, ...]) -> None:
    from pbrs_farm.transport.kernels.bsdf import evaluate_bsdf

    m = bsdf(*model)
    a, b = direction(0.4, 0.1), direction(1.1, 2.5)
    forth = evaluate_bsdf(m, a, b)[0][0].numpy()[0] / np.cos(1.1)
    back = evaluate_bsdf(m, b, a)[0][0].numpy()[0] / np.cos(0.4)
    assert forth == pytest.approx(back, rel=1e-4)


def test_thin_glass_of_index_1_5_reflects_8_percent_head_on() -> None:
    mi = mitsuba()
    from pbrs_farm.transport.kernels.bsdf import thin_glass_reflectance

    assert thin_glass_reflectance(mi.Float(1.0)).numpy()[0] == pytest.approx(0.0769, abs=1e-3)


@pytest.mark.parametrize("cos", [1.0, -0.5, 0.2])
def test_a_wall_of_glass_takes_as_much_light_as_the_way_through_it_is_long(cos: float) -> None:
    mi = mitsuba()
    from pbrs_farm.transport.kernels.bsdf import thin_glass_transmittance

    transmitted = thin_glass_transmittance(mi.Color3f(0.9, 1.0, 0.5), mi.Float(cos)).numpy().ravel()
    np.testing.assert_allclose(transmitted, np.array([0.9, 1.0, 0.5]) ** (1 / abs(cos)), rtol=1e-4)


def test_pairs_of_sobol_numbers_fill_every_cell_once() -> None:
    import drjit as dr

    mi = mitsuba()
    from pbrs_farm.transport.kernels.sampler import SobolSampler, stream_key

    s = dr.arange(mi.UInt32, 64)
    for pixel in (0, 1, 77):
        sampler = SobolSampler(stream_key(mi.UInt32(pixel), mi.UInt32(5)), s)
        for dim in (0, 12, 30):
            u = sampler.get_2d(mi.UInt32(dim)).numpy()
            for nx, ny in ((64, 1), (8, 8), (2, 32)):
                cells = (u[0] * nx).astype(int) * ny + (u[1] * ny).astype(int)
                assert len(np.unique(cells)) == 64


def test_neighbouring_streams_are_not_correlated() -> None:
    import drjit as dr

    mi = mitsuba()
    from pbrs_farm.transport.kernels.sampler import HashedSampler, stream_key

    lanes = dr.arange(mi.UInt32, 1 << 16)
    u = HashedSampler(stream_key(lanes, mi.UInt32(0)), mi.UInt32(0)).get_1d(mi.UInt32(3)).numpy()
    v = HashedSampler(stream_key(lanes, mi.UInt32(1)), mi.UInt32(0)).get_1d(mi.UInt32(3)).numpy()
    assert abs(np.corrcoef(u[:-1], u[1:])[0, 1]) < 4 / 256
    assert abs(np.corrcoef(u, v)[0, 1]) < 4 / 256
    assert u.mean() == pytest.approx(0.5, abs=0.005)
