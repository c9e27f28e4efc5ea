"""Stage: seed -> a furnished home as a Sweet Home 3D file; pure in (seed, wishes, Catalogue)."""
