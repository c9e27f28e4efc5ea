"""Where shadow rays and scattered rays are aimed: lamps near by, lampshades, portals."""
