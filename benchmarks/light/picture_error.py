"""How far a developed view lies from a long reference: relMSE of light, FLIP of the picture; no effects."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from benchmarks.renderers.picture_noise import relative_square
from pbrs_farm.core.recipe import ToneFields
from pbrs_farm.transport.develop.mode_pictures import LinearAovs, develop

F32 = NDArray[np.float32]


def relmse(picture: F32, reference: F32, halves: tuple[F32, F32]) -> float:
    """Mean squared relative error of luminance, less what the reference's own noise adds to it.

    halves: of the reference, independent: a quarter of their squared difference is its variance.
    """
    a, b = halves
    doubt = relative_square(reference + np.float32(0.5) * (a - b), reference).mean()
    return float(relative_square(picture, reference).mean() - doubt)


def flip(aovs: LinearAovs, reference: LinearAovs, tone: ToneFields) -> float:
    """Mean FLIP (Andersson et al. 2020) of the two light modes' pictures, as a user gets them.

    Both pairs of groups are denoised already, or meant to stay raw.
    """
    import flip_evaluator

    errors = []
    ours, theirs = (develop(x, tone, denoise=False) for x in (aovs, reference))
    for mode, image in theirs.items():
        pair = [np.float32(x.rgb_srgb8) / np.float32(255) for x in (image, ours[mode])]
        _map, mean, _parameters = flip_evaluator.evaluate(*pair, "LDR", applyMagma=False)
        errors.append(float(mean))
    return float(np.mean(errors))
