"""Costs of a view and of the demo."""
