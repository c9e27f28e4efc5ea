"""Solids and points of meshes, between the nouns and the stages; no effects."""
