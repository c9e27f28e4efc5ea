"""The forms of export: one module per form, named like the form and ending in `FORM = ...`."""
