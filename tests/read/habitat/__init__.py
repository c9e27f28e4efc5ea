"""Tests of the Habitat reader."""
