"""Choice of viewpoints by rules: number per room, what they see, why others were refused."""

import sys

import pbrs_farm as pf

home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
for preset in ("photo", "paper"):
    found = home.cameras(preset)
    print(preset, found, found.report.refused, sep="\n")
pf.render(home, home.cameras("photo", n=3), modes=["opengl_dl"]).save("out/camera_sampling")
