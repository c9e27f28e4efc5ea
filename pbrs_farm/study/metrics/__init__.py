"""Figures of predictions: normals, depth, classes, boundaries; numpy and scipy only."""
