"""Tests of the reader of MuJoCo models."""
