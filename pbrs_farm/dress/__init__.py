"""Stage: House -> House that looks lived in; pure in (House, Catalogue, fields)."""
