"""Rooms -> candidate cameras -> the best of each sector, with the reason for every rejection; no effects."""
