"""Render processes: how they are started, fed, watched and killed, on a laptop and on a farm."""
