"""Invariants of a dressed house, measured on meshes; violating items are removed again."""

from pbrs_farm.dress.gates.as_rendered import refit_to_walls
from pbrs_farm.dress.gates.bodies import piece_id
from pbrs_farm.dress.gates.keep_gates import group_of, keep_gates, pass_that_added

__all__ = ["group_of", "keep_gates", "pass_that_added", "piece_id", "refit_to_walls"]
