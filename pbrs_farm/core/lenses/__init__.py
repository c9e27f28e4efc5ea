"""Lens models: where in the picture's plane a direction falls, and back; numpy, no effects.

All models share one form: pixel = K @ (x, y, 1), and (x, y) in the plane belongs to a direction
with OpenCV's axes (x right, y down, z forward). A model is the pair of functions between the two.
"""
