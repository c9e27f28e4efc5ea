"""Things made from numbers: described in TOML, or in code where a description would bend; no effects."""
