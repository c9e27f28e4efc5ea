"""Frames along your own trajectory: TUM rows of time, position and quaternion."""

import sys
from pathlib import Path

import numpy as np

import pbrs_farm as pf

home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
x, z = np.asarray(home.house.rooms[0].polygon).mean(0)
y = home.house.rooms[0].floor_y + 1.5
rows = [f"{t / 10} {x + t * 0.05} {y} {z} 1 0 0 0" for t in range(4)]  # looking along -z
Path("way.txt").write_text("\n".join(rows) + "\n")
views = home.cameras(source="trajectory", file="way.txt")
pf.render(home, views, modes=["opengl_dl"]).save("out/trajectory")
