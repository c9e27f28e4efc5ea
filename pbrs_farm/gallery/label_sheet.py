"""Sheet of one view's labels: over the picture, magnified at an edge, with a legend. Reads pictures."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from pbrs_farm.core.arrays import Srgb8Image
from pbrs_farm.core.classes import NYU40_COLOURS, NYU40_NAMES
from pbrs_farm.core.errors import BadInput
from pbrs_farm.export.chosen_view import PICTURES
from pbrs_farm.formats.output_folder import ViewEntry
from pbrs_farm.gallery.contact_sheet import INK, PAPER
from pbrs_farm.gallery.label_colours import semantic_colours
from pbrs_farm.images import array_from_png
from pbrs_farm.regular_files import read_regular

_ZOOM: Final = 8  # scale factor of the magnified edge
_ROW_PX: Final = 24  # height of a row of the legend
_CHIP_PX: Final = 190  # width of an entry of the legend


def label_sheet(view: ViewEntry) -> Srgb8Image:
    """(H', W', 3): the picture, its classes laid over it with instance edges, the busiest edge of
    both eight times magnified, and a legend with each class's share of the picture.

    Raises BadInput when the view has no labels or no picture.
    """
    # Lay the classes over the picture and find the busiest edge of both.
    picture = _best_picture(view)
    semantic, boundary = _read_label(view, "semantic.png"), _read_label(view, "boundary.png")
    over = _overlaid(picture, semantic, boundary)
    window = _busiest(boundary)
    near = [_magnified(image[window]) for image in (picture, over)]
    # Stack: whole pictures, magnified edges, legend.
    top = np.concatenate([picture, over], axis=1)
    bottom = np.concatenate([_padded(image, picture.shape) for image in near], axis=1)
    return np.concatenate([top, bottom, legend(semantic, top.shape[1])], axis=0)


def legend(semantic: NDArray[Any], width_px: int) -> Srgb8Image:
    """(H', width_px, 3) chips of the NYU40 ids in semantic, 0 included, largest share first."""
    # List the visible classes, largest first.
    counts = np.bincount(semantic.reshape(-1), minlength=1)
    classes = [int(i) for i in np.argsort(-counts, kind="stable") if counts[i]]
    columns = max(1, width_px // _CHIP_PX)
    n_rows = -(-len(classes) // columns)
    sheet = Image.new("RGB", (width_px, _ROW_PX * n_rows + 8), PAPER)
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(14)
    for k, nyu40 in enumerate(classes):
        x, y = 8 + k % columns * _CHIP_PX, 6 + k // columns * _ROW_PX
        colour = tuple(NYU40_COLOURS[nyu40].tolist())
        draw.rectangle([x, y, x + 14, y + 14], colour, (90, 96, 110))
        share = 100 * counts[nyu40] / semantic.size
        draw.text((x + 22, y - 1), f"{NYU40_NAMES[nyu40]} {share:.1f} %", INK, font)
    return np.asarray(sheet, np.uint8)


def _best_picture(view: ViewEntry) -> Srgb8Image:
    for mode in PICTURES:
        if view.file(f"{mode}.png"):
            return np.asarray(_read_label(view, f"{mode}.png")[..., :3], np.uint8)
    raise BadInput(view.folder, "", "has no picture under the labels")


def _read_label(view: ViewEntry, file: str) -> NDArray[Any]:
    path = view.file(file)
    if path is None:
        raise BadInput(view.folder, file, "is missing")
    return array_from_png(read_regular(path), str(path))


def _overlaid(
    picture: Srgb8Image, semantic: NDArray[Any], boundary: NDArray[Any]
) -> NDArray[np.uint8]:
    # Mix half of each, and draw the instances' edges white.
    mixed = (picture.astype(np.uint16) + semantic_colours(semantic)) // 2
    mixed[boundary > 0] = (255, 255, 255)
    return mixed.astype(np.uint8)


def _busiest(boundary: NDArray[Any]) -> tuple[slice, slice]:
    """The window, an eighth of the picture each way, with the most boundary pixels."""
    height, width = (max(1, n // _ZOOM) for n in boundary.shape)
    # Sum over all windows with a summed-area table.
    edges = np.pad((boundary > 0).astype(np.int64), ((1, 0), (1, 0))).cumsum(0).cumsum(1)
    inside = edges[height:, width:] - edges[:-height, width:] - edges[height:, :-width]
    inside += edges[:-height, :-width]
    row, column = np.unravel_index(int(inside.argmax()), inside.shape)
    return slice(int(row), int(row) + height), slice(int(column), int(column) + width)


def _magnified(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.repeat(np.repeat(image, _ZOOM, axis=0), _ZOOM, axis=1)


def _padded(image: NDArray[np.uint8], shape: tuple[int, ...]) -> NDArray[np.uint8]:
    canvas = np.broadcast_to(np.array(PAPER, np.uint8), shape).copy()
    canvas[: image.shape[0], : image.shape[1]] = image[: shape[0], : shape[1]]
    return canvas
