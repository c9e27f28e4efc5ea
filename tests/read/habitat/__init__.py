"""Tests of the reader of Habitat scenes."""
