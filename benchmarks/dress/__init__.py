"""What dressing costs and what it makes, measured by means that are not the stage's own."""
