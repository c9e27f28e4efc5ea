"""The 6-D pose of a placed model in the camera's axes, and its projection into the picture."""

import sys

import numpy as np
import trimesh

import pbrs_farm as pf

trimesh.creation.box((0.1, 0.2, 0.06)).export("box.glb")
home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
home = home.place(pf.model("box.glb", category="box"), on=home.house.rooms[0], seed=1)
frame = pf.render(home, home.cameras_around(size=(320, 240))[0])
for row in frame.instances:
    if row.get("model"):
        t = np.array(row["camera_from_model_opencv"])[:3, 3]
        u, v, _ = frame.k @ t / t[2]
        print(f"{row['model']}: {t.round(3)} m from the camera, at pixel ({u:.0f}, {v:.0f})")
