"""A home from your own plan: rooms in metres, doors and windows."""

import json
from pathlib import Path

import pbrs_farm as pf

living = {"type": "living", "polygon": [[0, 0], [5, 0], [5, 4], [0, 4]]}
bedroom = {"type": "bedroom", "polygon": [[5, 0], [9, 0], [9, 4], [5, 4]]}
doors = [{"at": [5, 2], "width": 0.9}, {"at": [0, 2], "entrance": True}]
windows = [{"at": [2.5, 0], "width": 1.5}, {"at": [7, 0], "width": 1.3}]
plan = {"rooms": [living, bedroom], "doors": doors, "windows": windows}
Path("mine.json").write_text(json.dumps(plan))
home = pf.load("mine.json", recipe="preview")
print(home.rooms)
