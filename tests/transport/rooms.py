"""The rooms of the light tests; they live in the package, `pbrs-farm verify --light` uses them."""

from pbrs_farm.transport.validation.known_rooms import (
    BULB,
    Triple,
    box,
    bulb,
    camera,
    door_ajar,
    encoded,
    furnace,
    house,
    matte,
    panel,
    quad,
    shell,
    sphere,
    window_room,
)

__all__ = [
    "BULB",
    "Triple",
    "box",
    "bulb",
    "camera",
    "door_ajar",
    "encoded",
    "furnace",
    "house",
    "matte",
    "panel",
    "quad",
    "shell",
    "sphere",
    "window_room",
]
