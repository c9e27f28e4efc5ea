"""Views out of the windows of a home: ground, plants, buildings, hills; by a seed, no effects."""

from pbrs_farm.furnishings.surroundings.surroundings import with_surroundings

__all__ = ["with_surroundings"]
