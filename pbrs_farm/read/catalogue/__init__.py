"""Furniture and texture libraries -> core.catalogue.Catalogue."""
