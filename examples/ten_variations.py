"""The same home, lived in by three families."""

import sys

import pbrs_farm as pf

home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
for seed in range(1, 4):
    lived_in = home.dress(seed, clutter=0.3)
    print(lived_in, len(lived_in.items), "items")
