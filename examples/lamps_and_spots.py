"""Lamps with another flux and colour, an added bulb, a spot on the floor."""

import sys

import numpy as np

import pbrs_farm as pf

home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
room = home.house.rooms[0]
x, z = np.asarray(room.polygon).mean(0)
home = home.light("lamp", lm=300, kelvin=2700)
home = home.add_light((x, room.floor_y + 2.0, z), lm=600, kelvin=4000)
home = home.add_light(
    (x, room.floor_y + 2.2, z), lm=900, towards=(x, room.floor_y, z + 0.5), angle_deg=40
)
pf.render(home, home.cameras(n=1)).save("out/lamps_and_spots")
