"""Your own panorama outside: its light and the view through the windows."""

import sys
from pathlib import Path

import numpy as np

import pbrs_farm as pf
from pbrs_farm.plugin import exr_from_layers

row = np.linspace(3.0, 0.05, 64, dtype=np.float32)[:, None]
rgb = {name: np.tile(row * k, (1, 128)) for name, k in zip("RGB", (0.6, 0.8, 1.2), strict=True)}
Path("sky.exr").write_bytes(exr_from_layers({k: v.astype(np.float32) for k, v in rgb.items()}))
home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview").sky("sky.exr")
pf.render(home, home.cameras(n=1), modes=["mlt_ol"]).save("out/sky_behind_windows")
