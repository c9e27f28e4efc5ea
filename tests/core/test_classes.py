"""NYU40's ids by name."""

from pbrs_farm.core import classes


def test_every_class_has_a_constant_with_its_id() -> None:
    for number, name in enumerate(classes.NYU40_NAMES[1:], start=1):
        assert getattr(classes, name.upper().replace(" ", "_")) == number
