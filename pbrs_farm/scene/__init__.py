"""Homes as Python values: inspect, edit and render them. `import pbrs_farm` exports the names."""
