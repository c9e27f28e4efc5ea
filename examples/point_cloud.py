"""A coloured point cloud of a camera's view, as PLY."""

import sys

import trimesh

import pbrs_farm as pf

home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
frame = pf.render(home, home.cameras(n=1)[0], layers=["position"])
seen = frame.depth > 0
cloud = trimesh.PointCloud(frame.layer("position")[seen], frame.colour[seen])
cloud.export("cloud.ply")
print(len(cloud.vertices), "points within", cloud.extents.round(1), "m")
