"""Procedural surfaces: they repeat without a seam, and equal patterns give equal pixels."""

from functools import cache

import numpy as np
import pytest

from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.noise import blurred, noise
from pbrs_farm.dress.patterns import Pattern, pattern_material
from pbrs_farm.dress.style import WOODS
from pbrs_farm.dress.surface_maps import normals_from_height
from pbrs_farm.furnishings.textures import families
from pbrs_farm.furnishings.textures.families import FAMILIES, size_of
from pbrs_farm.furnishings.textures.wallpaper import PATTERNS, PLAIN
from pbrs_farm.read.builtin.builtin_home import builtin_home

maps_of = cache(families.maps_of)  # each is painted once for the tests of this module

GREEN = ((0.7, 0.75, 0.7), (0.5, 0.6, 0.5), (0.3, 0.5, 0.4))
ALL = [
    *(Pattern(f, 5, GREEN, variant="20" if f == "tiles" else "leaves") for f in FAMILIES),
    *(Pattern("wallpaper", 6, GREEN, variant=v) for v in (*PATTERNS, *PLAIN)),
    *(
        Pattern("tiles", 6, GREEN, variant=v)
        for v in ("60-stone", "10-checker", "mosaic-mixed", "subway")
    ),
]


@pytest.mark.quick(8)
@pytest.mark.parametrize("pattern", ALL, ids=lambda p: f"{p.family} {p.variant}")
def test_a_step_over_an_edge_is_no_larger_than_steps_inside(pattern: Pattern) -> None:
    colour = maps_of(pattern).colour.astype(float)
    for axis in (0, 1):
        steps = np.abs(np.diff(colour, axis=axis, append=colour.take([0], axis))).mean(
            (1 - axis, 2)
        )
        # Joints are steps too: compare with the largest of all lines, noise with the median.
        assert steps[-1] <= max(steps[:-1].max() * 1.05, np.median(steps) * 1.5)


@pytest.mark.quick(8)
@pytest.mark.parametrize("pattern", ALL, ids=lambda p: f"{p.family} {p.variant}")
def test_the_size_of_a_pattern_is_known_before_it_is_painted(pattern: Pattern) -> None:
    assert size_of(pattern) == maps_of(pattern).size_m


@pytest.mark.quick(4)
@pytest.mark.parametrize("family", FAMILIES)
def test_equal_patterns_give_equal_pixels_and_other_seeds_others(family: str) -> None:
    a, b, c = (families.maps_of(Pattern(family, s, GREEN, variant="20" if family == "tiles" else "stripes")) for s in (1, 1, 2))  # fmt: skip
    assert np.array_equal(a.colour, b.colour)
    assert not np.array_equal(a.colour, c.colour)


@pytest.mark.parametrize("family", ["paint", "plaster", "carpet", "concrete"])
def test_a_plain_surface_has_its_tint_as_mean_colour(family: str) -> None:
    colour = maps_of(Pattern(family, 3, GREEN)).colour
    assert np.abs(colour.reshape(-1, 3).mean(0) / 255 - GREEN[0]).max() < 0.02


def test_rings_of_veneer_are_a_few_millimetres_wide() -> None:
    for wood in ("oak", "beech", "walnut"):
        maps = maps_of(Pattern("grain", 1, wood=WOODS[wood]))
        rows = maps.colour.astype(float).mean(2)
        power = (np.abs(np.fft.rfft(rows - rows.mean(0), axis=0)) ** 2).mean(1)
        per_m = np.arange(len(power)) / maps.size_m[1]
        rings = (per_m > 60) & (per_m < 600)
        assert 180 < np.average(per_m[rings], weights=power[rings]) < 400, wood


def test_dark_wood_makes_a_darker_floor_than_pale_wood() -> None:
    means = [sum(maps_of(Pattern("strip", 1, wood=WOODS[w])).mean_rgb) for w in ("wenge", "oak", "birch")]  # fmt: skip
    assert means == sorted(means)


def test_normals_lean_away_from_a_rise_along_u_and_v() -> None:
    x = np.sin(2 * np.pi * (np.arange(64) + 0.5) / 64).astype(np.float32)
    # On the rising quarter of the wave along u, the surface faces back along u.
    along_u = normals_from_height(np.tile(0.05 * x, (64, 1)), (1.0, 1.0))
    assert along_u[0, 0, 0] < 120 < 135 < along_u[0, 32, 0]
    # Row 0 is the upper edge: height that rises with the row falls with v.
    along_v = normals_from_height(np.tile(0.05 * x[:, None], (1, 64)), (1.0, 1.0))
    assert along_v[0, 0, 1] > 135


def test_noise_is_of_unit_deviation_and_a_blur_keeps_its_mean() -> None:
    field = noise(np.random.default_rng(0), (64, 128), slope=2.0) + np.float32(3)
    assert abs(float(field.std()) - 1) < 1e-3
    assert abs(float(blurred(field, 3.0).mean()) - 3) < 1e-3


def test_a_pattern_requested_repeatedly_is_one_material() -> None:
    house = builtin_home()
    mutable = MutableHouse(house, 1)
    pattern = Pattern("tiles", 7, GREEN, variant="30")
    first, second = pattern_material(mutable, pattern), pattern_material(mutable, pattern)
    assert first == second
    material = mutable.materials[first.number]
    assert set(material.texture_ids) <= set(mutable.textures)
    assert len(material.texture_ids) == 3
