"""Export an output folder in the forms of other tools; export_views.py lists them, a module each."""
