"""Images -> histograms -> similarity -> verdicts that merge (paper section 3.3); no effects."""

from pbrs_farm.selection.histograms import Histogram, histogram
from pbrs_farm.selection.quality import PictureQuality, SceneQuality, picture_quality, scene_quality
from pbrs_farm.selection.view_record import SCORED_MODE, ViewRecord, record_from_json, view_record

__all__ = [
    "SCORED_MODE",
    "Histogram",
    "PictureQuality",
    "SceneQuality",
    "ViewRecord",
    "histogram",
    "picture_quality",
    "record_from_json",
    "scene_quality",
    "view_record",
]
