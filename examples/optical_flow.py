"""Optical flow and occlusion between the frames of a walk."""

import sys

import numpy as np

import pbrs_farm as pf

home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
walk = home.cameras(source="walk", walk_frames=3)
frames = pf.render(home, walk, modes=["opengl_dl"], layers=["flow_forward", "occlusion_forward"])
flow = frames[0].layer("flow_forward").astype(np.float32)
seen = frames[0].layer("occlusion_forward") == 0
print(f"mean flow {np.linalg.norm(flow[seen], axis=-1).mean():.2f} px over {seen.mean():.0%}")
