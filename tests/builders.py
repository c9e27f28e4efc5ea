"""Inputs for tests, built in code."""

from __future__ import annotations

from pbrs_farm.read.builtin import builtin_home

__all__ = ["builtin_home"]
