"""Cameras on a ring around an item, for reconstruction; exported for nerfstudio."""

import sys
from math import cos, pi, sin

import pbrs_farm as pf

home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
x, y, z = home.items.named("table")[0].bounds.mean(0)
ring = [(x + cos(k * pi / 4), y + 0.9, z + sin(k * pi / 4)) for k in range(8)]
cameras = [pf.Camera.look_at(eye, (x, y, z), size=(320, 240)) for eye in ring]
pf.render(home, cameras, modes=["opengl_dl"]).save("out/orbit/views")
pf.export_views("out/orbit/views", "out/orbit/nerfstudio", "nerfstudio")
