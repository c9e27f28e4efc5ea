"""A wide aperture focused on the middle of the picture."""

import sys

import pbrs_farm as pf

home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
home = home.set(**{"blur.aperture_mm": 25.0})
pf.render(home, home.cameras(n=1)).save("out/depth_of_field")
