"""Tests of the reader of URDF and SDF."""
