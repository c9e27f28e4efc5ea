"""An output folder in the forms other tools read; export_views.py lists them, a module each."""
