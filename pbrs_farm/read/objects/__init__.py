"""Single models without context -> House of one item."""
