"""What a room is for, by what it is called."""

from dataclasses import replace

import pytest

from pbrs_farm.dress.space.room_kinds import RoomKind, room_kind
from tests.builders import builtin_home


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
def test_a_room_is_what_its_name_says_in_many_languages(name: str, kind: RoomKind) -> None:
    room = replace(builtin_home().rooms[0], name=name, types=())
    assert room_kind(room, [], 12.0) is kind
