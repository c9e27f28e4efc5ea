"""A stereo pair of 65 mm with its disparity, and the dots of an infrared projector between both."""

import sys

import pbrs_farm as pf

home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview").set(**{"cameras.stereo_m": 0.065})
left, right = pf.render(
    home, home.cameras(n=1), modes=["opengl_dl"], layers=["disparity", "projector"]
)
print(left.id, right.id, f"{left.layer('disparity').max() / 256:.1f} px at most")
print(f"{(left.layer('projector') > 0).mean():.0%} of the pixels are lit by a dot")
