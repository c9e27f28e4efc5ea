"""A custom picture: the room half an hour after sunset, its lamps on and the sky dim and blue.

pbrs-farm run builtin --set tone.pictures=dusk --out out/dusk
"""

from __future__ import annotations

from typing import Any

from pbrs_farm.plugin import develop

SKY = (0.002, 0.003, 0.006)  # share of the day's outdoor light, red, green and blue


def dusk(light: Any, tone: Any) -> Any:
    """(H, W, 3) uint8 picture of a view's light groups, denoised if the recipe says so.

    light: outdoor, indoor (radiance, linear sRGB), albedo, normal, each (H, W, 3) float32.
    tone: the recipe's tone fields.
    """
    return develop(light, tone, denoise=False, outdoor=SKY)["mlt_il_ol"].rgb_srgb8
