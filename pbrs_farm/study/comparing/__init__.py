"""Comparison of rendered views with photographs."""
