"""A source becomes a House: read by its reader, or generated and then read; the one way in.

Effects: those of read/source.py; a made home takes its furniture from the cached package.
"""

from __future__ import annotations

from dataclasses import replace

from pbrs_farm.core.catalogue import EMPTY
from pbrs_farm.core.house import House
from pbrs_farm.core.made_home import made_homes
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.source import SourceRef, check_unchanged, home_id, read_house
from pbrs_farm.run.dress_catalogue import catalogue_of_words

_MADE_BY = "home: made by pbrs_farm, CC0"


def house_of_source(source: SourceRef, fields: ReadFields) -> House:
    """The house as its source gives it, unrepaired. Raises BadHouse, BadInput, MachineFailed."""
    return _made_house(source, fields) if source.kind == "made" else read_house(source, fields)


def _made_house(source: SourceRef, fields: ReadFields) -> House:
    from pbrs_farm.generate.made import made
    from pbrs_farm.read.sweethome3d import read_home

    # The package must be the one that the home was named with: other models, another home.
    check_unchanged(source)
    (home,) = made_homes(source.location)
    # An empty home needs no package, so that it is made where none can be read.
    catalogue = catalogue_of_words("") if home.furniture else EMPTY
    data = made(home, catalogue).data
    house = read_home(data, f"{home.name}.sh3d", fields=fields)
    credit = house.source.attribution.replace("pbrs_farm", _MADE_BY, 1)
    its_source = replace(house.source, kind="made", file=source.location, attribution=credit)
    return replace(house, id=home_id(source), source=its_source)
