"""Costs and results of the study."""
