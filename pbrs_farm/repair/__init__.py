"""Repair: House -> House that light cannot leak through, with a report. No effects."""

from pbrs_farm.repair.occluder import Occluder
from pbrs_farm.repair.picture import cut_picture
from pbrs_farm.repair.report import RepairReport
from pbrs_farm.repair.stage import repair
from pbrs_farm.repair.words import plain_words

__all__ = ["Occluder", "RepairReport", "cut_picture", "plain_words", "repair"]
