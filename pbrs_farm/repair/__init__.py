"""Repair: House -> House that light cannot leak through, with a report. No effects."""

from pbrs_farm.repair.measure.leaks import Occluder
from pbrs_farm.repair.repair_house import repair
from pbrs_farm.repair.repair_report import RepairReport
from pbrs_farm.repair.report_text import summary_of_report
from pbrs_farm.repair.section_drawing import section_svg

__all__ = ["Occluder", "RepairReport", "repair", "section_svg", "summary_of_report"]
