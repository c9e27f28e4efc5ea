"""Colour and depth as from a first-generation Kinect."""

import sys

import pbrs_farm as pf

home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview").set(**{"sensor.preset": "kinect"})
frame = pf.render(home, home.cameras(n=1)[0], layers=["depth_sensor"])
measured = frame.layer("depth_sensor") / 1000
print(f"{(measured > 0).mean():.0%} of pixels have a depth")
