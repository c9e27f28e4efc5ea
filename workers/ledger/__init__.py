"""What is done, leased and waiting: one interface, and Redis behind it."""
