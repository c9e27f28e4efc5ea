"""Weights of pbrs_farm's networks: a folder for each task, with a card that names training data and accuracy."""
