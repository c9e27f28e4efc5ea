"""A walk through a home as a GIF, with its poses."""

import sys

from PIL import Image

import pbrs_farm as pf

home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
walk = home.cameras(source="walk", walk_frames=6)
frames = pf.render(home, walk, modes=["opengl_dl"])
pictures = [Image.fromarray(frame.colour) for frame in frames]
pictures[0].save("walk.gif", save_all=True, append_images=pictures[1:], duration=100)
