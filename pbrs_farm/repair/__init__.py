"""Repair: House -> House that light cannot leak through, with a report. No effects."""

from pbrs_farm.repair.measure.occluder import Occluder
from pbrs_farm.repair.repair_house import repair
from pbrs_farm.repair.repair_report import RepairReport
from pbrs_farm.repair.section_drawing import section_svg
from pbrs_farm.repair.summary_text import summary_of_report

__all__ = ["Occluder", "RepairReport", "repair", "section_svg", "summary_of_report"]
