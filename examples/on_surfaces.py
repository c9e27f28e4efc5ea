"""Your own models on the tables, shelves and the floor of one room."""

import sys

import trimesh

import pbrs_farm as pf

trimesh.creation.cylinder(radius=0.03, height=0.12).export("can.ply")
home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
room = home.rooms[0]["id"]
home = home.scatter([pf.model("can.ply")], n=8, in_=room, seed=2)
pf.render(home, home.cameras_around(n=2, size=(320, 240)), modes=["opengl_dl"]).save(
    "out/on_surfaces"
)
