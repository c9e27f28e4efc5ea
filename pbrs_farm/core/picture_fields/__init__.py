"""The recipe's fields of a real camera: lens, blur, sensor; presets with the source of each number."""
