"""A data set for detectors: COCO and YOLO of the same views."""

import sys

import pbrs_farm as pf

home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
pf.render(home, home.cameras(n=2), modes=["opengl_dl"]).save("out/detect/views")
for form in ("coco", "yolo"):
    print(form, pf.export_views("out/detect/views", f"out/detect/{form}", form))
