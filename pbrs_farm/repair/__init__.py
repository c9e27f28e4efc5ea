"""Repair: House -> House that light cannot leak through, with a report. No effects."""

from pbrs_farm.repair.occluder import Occluder
from pbrs_farm.repair.report import RepairReport
from pbrs_farm.repair.stage import repair

__all__ = ["Occluder", "RepairReport", "repair"]
