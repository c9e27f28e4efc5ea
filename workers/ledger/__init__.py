"""State of all tasks (done, leased, waiting): one interface, and its implementation in Redis."""
