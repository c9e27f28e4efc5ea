"""Room types from room names."""

from dataclasses import replace

import pytest

from pbrs_farm.core.house import Item, ItemKind
from pbrs_farm.home.room_use import RoomKind, is_lived_in, room_kind
from pbrs_farm.read.builtin.builtin_home import builtin_home


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("Living_Room", RoomKind.LIVING), ("Küche", RoomKind.KITCHEN), ("Salle de bains", RoomKind.BATHROOM),
        ("Séjour", RoomKind.LIVING), ("Baño 2", RoomKind.BATHROOM), ("Łazienka", RoomKind.BATHROOM),
        ("Dormitorio principal", RoomKind.BEDROOM), ("Кухня", RoomKind.KITCHEN), ("ванная", RoomKind.BATHROOM),
        ("주방", RoomKind.KITCHEN), ("主卧", RoomKind.BEDROOM), ("リビング", RoomKind.LIVING),
        ("Bedrooms", RoomKind.BEDROOM), ("Gang", RoomKind.HALL), ("Balcon", RoomKind.OUTDOOR),
    ],
)  # fmt: skip
def test_a_rooms_name_gives_its_use_in_many_languages(name: str, kind: RoomKind) -> None:
    room = replace(builtin_home().rooms[0], name=name, types=())
    assert room_kind(room, [], 12.0) is kind


@pytest.mark.parametrize(
    "name",
    ["Courtyard", "Lawn", "Backyard", "Gazebo", "Driveway", "Cour", "Hof", "Pergola", "Balconies",
     "庭", "中庭", "терраса 2"],
)  # fmt: skip
def test_outdoor_names_are_not_living_rooms(name: str) -> None:
    room = replace(builtin_home().rooms[0], name=name, types=())
    assert room_kind(room, [], 12.0) is RoomKind.OUTDOOR
    assert not is_lived_in(room, 12.0)


@pytest.mark.parametrize("name", ["Garage", "Carport 2", "Cochera", "车库", "Stellplatz"])
def test_a_garage_stores_and_is_not_lived_in(name: str) -> None:
    room = replace(builtin_home().rooms[0], name=name, types=())
    assert room_kind(room, [], 12.0) is RoomKind.STORE
    assert not is_lived_in(room, 12.0)


@pytest.mark.parametrize("others", [("fridge",), ("toilet",), ("fridge", "bathtub")])
def test_an_unnamed_room_with_a_sofa_is_a_living_room(others: tuple[str, ...]) -> None:
    classes = {"sofa": 6, "fridge": 24, "toilet": 33, "bathtub": 36}
    items = [
        Item(name, name, ItemKind.OBJECT, "0", (), classes[name]) for name in ("sofa", *others)
    ]
    room = replace(builtin_home().rooms[0], name="", types=())
    assert room_kind(room, items, 30.0) is RoomKind.LIVING


def test_a_family_room_is_no_garden() -> None:
    room = replace(builtin_home().rooms[0], name="家庭室", types=())
    assert is_lived_in(room, 12.0)
