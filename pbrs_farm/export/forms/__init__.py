"""The forms of export: a module a form, which is called as the form and ends `FORM = ...`."""
