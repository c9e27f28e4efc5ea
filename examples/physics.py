"""Boxes dropped on a piece of furniture come to rest (extra physics)."""

import sys

import trimesh

import pbrs_farm as pf

trimesh.creation.box((0.08, 0.05, 0.12)).export("brick.glb")
home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
home = home.scatter([pf.model("brick.glb")], n=6, on="table", physics=True, seed=1)
print(home.items.named("brick*")[0].pose)
pf.render(home, home.cameras_around(n=1, size=(320, 240))).save("out/physics")
