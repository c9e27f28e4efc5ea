"""3D-FRONT: how it is read."""
