"""Walls in another colour, floors of another picture."""

import sys

import numpy as np
from PIL import Image

import pbrs_farm as pf

tiles = np.kron([[230, 60], [60, 230]], np.ones((64, 64))).astype(np.uint8)
Image.fromarray(tiles).convert("RGB").save("tiles.png")
home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
home = home.paint("wall*", "#8fa89b").material("floor*", "tiles.png", scale_m=0.6)
pf.render(home, home.cameras(n=2)).save("out/materials")
