"""Repair: House -> House that light cannot leak through, with a report. No effects."""

from pbrs_farm.repair.measure.occluder import Occluder
from pbrs_farm.repair.repair_house import repair
from pbrs_farm.repair.report import RepairReport
from pbrs_farm.repair.section_drawing import cut_picture
from pbrs_farm.repair.summary_text import plain_words

__all__ = ["Occluder", "RepairReport", "cut_picture", "plain_words", "repair"]
