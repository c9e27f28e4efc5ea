"""Pictures from given poses: OpenCV axes and a given K."""

import sys

import numpy as np

import pbrs_farm as pf

home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
x, z = np.asarray(home.house.rooms[0].polygon).mean(0)
K = [[260.0, 0, 160], [0, 260, 120], [0, 0, 1]]
pose = np.diag([1.0, -1, -1, 1])  # looks along -z, level
cameras = []
for height in (1.2, 1.6):
    pose[:3, 3] = x, home.house.rooms[0].floor_y + height, z
    cameras.append(pf.Camera.from_opencv(pose, K, size=(320, 240)))
pf.render(home, cameras).save("out/given_poses")
