"""A target among distractors, seen by at least a third."""

import sys

import trimesh

import pbrs_farm as pf

trimesh.creation.box((0.05, 0.1, 0.04)).export("target.glb")
trimesh.creation.icosphere(radius=0.03).export("other.glb")
home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
home = home.place(pf.model("target.glb"), on="table", name="target")
home = home.scatter([pf.model("other.glb")], n=8, on="table", seed=3)
views = home.cameras_around("target", n=2, min_visible=0.33, size=(320, 240))
pf.render(home, views, modes=["opengl_dl"]).save("out/distractors")
