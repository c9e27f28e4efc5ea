"""Tests of the MuJoCo reader."""
