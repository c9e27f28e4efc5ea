"""The colour of surfaces without light, beside the lit picture."""

import sys

import pbrs_farm as pf

home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
frame = pf.render(home, home.cameras(n=1)[0], layers=["albedo"])
print(frame.layer("albedo").mean((0, 1)).round(), "and lit", frame.colour.mean((0, 1)).round())
