"""Light sources of lamps -> LightPart in the world; no effects."""

from __future__ import annotations

import numpy as np

from pbrs_farm.core.arrays import triple
from pbrs_farm.core.frames import linear_from_srgb
from pbrs_farm.core.house import LightPart
from pbrs_farm.core.lighting import BULB_RADIUS_M, PowerUnit
from pbrs_farm.read.sweethome3d.home_file.home_xml import PlanPiece
from pbrs_farm.read.sweethome3d.placement import PieceFrame


def light_parts(
    piece: PlanPiece, frame: PieceFrame, emitting: tuple[int, ...]
) -> tuple[LightPart, ...]:
    """One part per light source; none where the lamp is switched off.

    emitting: the item's surfaces that glow; they belong to the first source. A lamp whose model
    glows but has no source gets one in the middle of its box.
    """
    if piece.power <= 0:
        return ()
    width, height, depth = 2 * frame.half
    sources = [
        (
            np.array(
                [
                    (s.at[0] - 0.5) * width * frame.mirror,
                    (s.at[2] - 0.5) * height,
                    (0.5 - s.at[1]) * depth,
                ]
            ),
            s.colour,
            BULB_RADIUS_M if s.diameter is None else s.diameter * width / 2,
        )
        for s in piece.lights
    ]
    # A lamp that only has a glowing mesh gets a source in its middle.
    if not sources and emitting:
        sources = [(np.zeros(3), (1.0, 1.0, 1.0), BULB_RADIUS_M)]
    # Share the lamp's power by the sources' brightness; colours keep their hue at full value.
    strength = [max(colour) for _, colour, _ in sources]
    total = sum(strength)
    parts: list[LightPart] = []
    for k, (local, colour, radius) in enumerate(sources):
        if total <= 0 or strength[k] <= 0:
            continue
        rgb = linear_from_srgb(np.array(colour) / max(colour))
        x, y, z = frame.world(local[None])[0]
        parts.append(
            LightPart(
                position=(float(x), float(y), float(z)),
                radius_m=max(float(radius), 1e-3),
                power=piece.power,
                unit=PowerUnit.SWEETHOME3D,
                share=strength[k] / total,
                rgb_linear=triple(rgb),
                emitting=emitting if not parts else (),
            )
        )
    return tuple(parts)
