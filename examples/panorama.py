"""A full sphere around a viewpoint, with depth along each ray."""

import sys

import pbrs_farm as pf

home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
sphere = {"lens.model": "equirect", "image.width_px": 320, "image.height_px": 160}
home = home.set(**sphere)
pf.render(home, home.cameras(n=1)).save("out/panorama")
