"""NOCS coordinates: the point on its model for each pixel of a placed object."""

import sys

import trimesh

import pbrs_farm as pf

trimesh.creation.box((0.1, 0.2, 0.06)).export("box.glb")
home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
home = home.place(pf.model("box.glb", category="box"), on=home.house.rooms[0], seed=1)
frame = pf.render(home, home.cameras_around(size=(320, 240))[0], layers=["nocs"])
coordinates = frame.layer("nocs") / 65535
print(coordinates[coordinates.any(-1)].mean(0).round(2), "is the mean of what is seen")
