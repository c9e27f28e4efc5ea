"""One picture of a real home with its labels, in memory."""

import sys

import pbrs_farm as pf

home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
frame = pf.render(home, home.cameras("photo", n=1)[0])
print(frame, frame.colour.shape, f"{frame.depth.max():.1f} m deep")
print(frame.instances)
frame.save("out/first_picture")
