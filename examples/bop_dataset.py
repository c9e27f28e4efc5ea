"""Training data for 6-D poses: models on a real table, in the layout of the BOP challenge."""

import sys

import trimesh

import pbrs_farm as pf

trimesh.creation.cylinder(radius=33, height=122).export("obj_000001.ply")
home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
can = pf.model("obj_000001.ply", category="bottle", unit="mm", name="obj_000001")
for seed in range(2):
    scene = home.scatter([can], n=4, on="table", seed=seed)
    views = scene.cameras_around(n=2, size=(320, 240), seed=seed)
    pf.render(scene, views, modes=["opengl_dl"]).save("out/bop/views")
print(pf.export_views("out/bop/views", "out/bop/bop", "bop"))
