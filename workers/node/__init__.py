"""A worker's processes: supervisor, slot, renderer."""
