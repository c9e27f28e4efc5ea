"""Parse a home file into a Plan of plain values, without building geometry; no effects."""
