"""A view's arrays in the form used for training, and requests for them; frozen values, no effects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.checked_calls import as_words, check_fields
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.lighting import Mode
from pbrs_farm.core.shown_text import hint_of_choice
from pbrs_farm.views.normal_axes import AXES

# Layers of a request. "normal" brings "valid" along.
LAYERS: Final = ("colour", "normal", "depth", "class40", "instance", "boundary")
MODES: Final = tuple(str(mode) for mode in Mode)
Size = tuple[int, int]  # width, height in pixels


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """One view in one lighting mode: all arrays are (H, W, ...); a layer not asked for is None.

    Pixel (row 0, column 0) is top left, with its centre at (0.5, 0.5). K maps (x right, y down,
    z forward) to pixels, whatever the axes of the normals.
    """

    id: str  # <house>/<view>
    house: str
    room: str
    mode: str  # of colour
    K: NDArray[np.float32]  # (3, 3)
    axes: str  # of normal: a name of AXES
    colour: NDArray[np.uint8] | None = None  # (H, W, 3) sRGB
    normal: NDArray[np.float32] | None = None  # (H, W, 3) unit in camera axes; 0 where not valid
    valid: NDArray[np.bool_] | None = None  # (H, W) where normal is known
    depth: NDArray[np.float32] | None = None  # (H, W) metres along the axis; 0 = nothing
    class40: NDArray[np.uint8] | None = None  # (H, W) NYU40 id, 0 = none
    instance: NDArray[np.uint16] | None = None  # (H, W) 0 = nothing
    boundary: NDArray[np.bool_] | None = None  # (H, W) instances meet here

    @property
    def size(self) -> Size:
        """Width and height of the first array, in pixels; (0, 0) without arrays."""
        first = next(iter(self.arrays().values()), np.zeros((0, 0)))
        return int(first.shape[1]), int(first.shape[0])

    def arrays(self) -> dict[str, NDArray[Any]]:
        """The arrays that are not None, by field; valid beside normal.

        The arrays themselves, not copies, in the order of LAYERS.
        """
        named = ((name, getattr(self, name)) for name in (*LAYERS, "valid"))
        return {name: array for name, array in named if array is not None}


@dataclass(frozen=True, slots=True)
class SampleRequest:
    """The layers to read of a view. Raises BadInput for an invalid layer, mode, axes or size.

    mode: of colour. axes: of normals. size: (width, height) to resize to, None as stored.
    """

    layers: tuple[str, ...] = ("colour", "normal")
    mode: str = "mlt_il_ol"
    axes: str = "opencv"
    size: Size | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "layers", as_words(self.layers))
        check_fields(self)
        for layer in self.layers:
            if layer not in LAYERS:
                raise BadInput("layers", layer, "no such layer", hint=hint_of_choice(layer, LAYERS))
        if self.mode not in MODES:
            hint = f"of {', '.join(MODES)}"
            raise BadInput("mode", self.mode, "no such lighting mode", hint=hint)
        if self.axes not in AXES:
            raise BadInput("axes", self.axes, "no such axes", hint=f"of {', '.join(AXES)}")
        if self.size is not None and min(self.size) < 1:
            raise BadInput("size", str(self.size), "expected a width and height of 1 or more")
