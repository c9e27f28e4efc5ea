"""SUNCG houses (house.json and what it names) -> House."""
