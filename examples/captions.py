"""Plain English of what each view shows, from the scene itself."""

import sys
from pathlib import Path

import pbrs_farm as pf

home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
pf.render(home, home.cameras(n=2), modes=["opengl_dl"]).save("out/captions/views")
pf.export_views("out/captions/views", "out/captions/text", "captions")
print(Path("out/captions/text/captions.jsonl").read_text()[:400])
