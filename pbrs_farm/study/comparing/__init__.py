"""Our views beside photographs: what differs, and in which views most."""
