"""A data set for detectors: COCO and YOLO of the same views."""

import sys
from pathlib import Path

import pbrs_farm as pf
from pbrs_farm.export.export_views import export

home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
pf.render(home, home.cameras(n=2), modes=["opengl_dl"]).save("out/detect/views")
for form in ("coco", "yolo"):
    print(form, export(Path("out/detect/views"), Path(f"out/detect/{form}"), form))
