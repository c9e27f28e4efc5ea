"""Generated content: furniture and small items, textures, textiles, prints, surroundings; no effects."""
