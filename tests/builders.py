"""Inputs for tests, built in code."""

from __future__ import annotations

from pbrs_farm.read.builtin.builtin_home import builtin_home

__all__ = ["builtin_home"]
