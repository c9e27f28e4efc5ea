"""One view in the paper's four lighting modes, and its light by each lamp to mix again."""

import sys

import pbrs_farm as pf

home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview").set(**{"light.groups": "lamps"})
modes = ["opengl_dl", "opengl_il", "mlt_ol", "mlt_il_ol"]
frame = pf.render(home, home.cameras(n=1)[0], modes=modes)
print({mode: frame.picture(mode).mean().round(1) for mode in modes})
print(frame.table["modes"]["light"]["lamps"])
