"""Photographs with depth, and NYUv2's: what is true of them, to train and to judge on."""
