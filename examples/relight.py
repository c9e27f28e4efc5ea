"""One view, its lamps and daylight mixed again without rendering."""

import subprocess
import sys
from pathlib import Path

import pbrs_farm as pf

home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview").set(**{"light.groups": "lamps"})
frame = pf.render(home, home.cameras(n=1)[0])
frame.save("out/relight")
view = Path("out/relight/houses") / frame.ref.house / "views" / frame.ref.view
words = ["relight", str(view), "--outdoor", "0.1", "--out", "evening.png"]
subprocess.run([sys.executable, "-m", "pbrs_farm.cli", *words], check=True)
