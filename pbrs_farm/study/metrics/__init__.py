"""How good a prediction is: normals, classes, boundaries; numpy and scipy alone, no effects."""
