"""What a home means: rooms, names, lamps; between the nouns and the stages, no effects."""
