"""One view under the sun of five hours."""

import sys

import pbrs_farm as pf

home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
camera = home.cameras(n=1)
for hour, (azimuth, elevation) in {7: (80, 8), 12: (180, 55), 18: (280, 8)}.items():
    lit = home.sun(azimuth=azimuth, elevation=elevation)
    pf.render(lit, camera, modes=["mlt_ol"]).save(f"out/sun_over_a_day/{hour}")
