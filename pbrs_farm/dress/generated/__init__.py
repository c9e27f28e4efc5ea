"""Small things made from numbers: books, tableware, boxes, cushions; pure in (rng, Style)."""
