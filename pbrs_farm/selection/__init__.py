"""Images -> histograms -> similarity -> verdicts that merge (paper section 3.3); no effects."""

from pbrs_farm.selection.histograms import Histogram, histogram
from pbrs_farm.selection.quality import picture_quality, scene_quality, view_record

__all__ = ["Histogram", "histogram", "picture_quality", "scene_quality", "view_record"]
