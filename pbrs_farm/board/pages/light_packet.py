"""Light layers of a view as half floats for the browser, in one packet. Effects: a process.

"PBLT", length of the JSON, the JSON (padded with spaces to a multiple of four), then (H, W, 3)
little-endian float16 of each plane in the JSON: albedo, outdoor, and indoor or the lamps. Radiance is
multiplied by `scale`, a power of two, to fit the range of half floats. `python -m` this module reads
the view's files from stdin and writes the packet to stdout, as the denoiser needs much memory.
"""

from __future__ import annotations

import json
import math
import struct
import sys
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.board.module_process import output_of_module
from pbrs_farm.core.errors import BadInput, PbrsError
from pbrs_farm.core.recipe import recipe_from_json
from pbrs_farm.core.recipe_fields import ToneFields
from pbrs_farm.core.shown_text import shown
from pbrs_farm.formats.radiance_exr import radiance_from_exr

MAGIC: Final = b"PBLT"
_LARGEST: Final = 60_000.0  # below the maximum of a half float
_TIMEOUT_S: Final = 180.0
_HEAD: Final = struct.Struct("<III?")  # bytes of radiance.exr, view.json, recipe.json; denoise


def light_packet_in_process(
    radiance: bytes, view_json: bytes, recipe: bytes, *, denoise: bool
) -> bytes:
    """The packet of a view from another process. Raises BadInput if that fails."""
    head = _HEAD.pack(len(radiance), len(view_json), len(recipe), denoise)
    files = b"".join((head, radiance, view_json, recipe))
    module = "pbrs_farm.board.pages.light_packet"
    data = output_of_module(module, [], subject="relight", timeout_s=_TIMEOUT_S, stdin=files)
    if data[:4] != MAGIC:
        raise BadInput("relight", "", "the process wrote no packet")
    return data


def light_packet(radiance: bytes, view_json: bytes, recipe: bytes, *, denoise: bool) -> bytes:
    """The packet of a view's light. Raises BadInput, and MachineFailed without a denoiser.

    radiance, recipe: bytes of radiance.exr and recipe.json. Planes: outdoor light, each lamp with a
    layer or else all indoor light, and the albedo. Light includes glare and is scaled by `scale_of`.
    """
    from pbrs_farm.run.relight import relight_layers
    from pbrs_farm.transport.develop.tone_mapping import add_glare, exposure_of

    tone = _tone_of(view_json, recipe)
    rows = lamp_rows(view_json)
    layers = relight_layers(radiance_from_exr(radiance, "radiance.exr"), rows, denoise=denoise)
    light = {"outdoor": layers.aovs.outdoor}
    light |= {f"lamp{n}": layer for n, layer in sorted(layers.lamps.items())}
    if not layers.lamps:
        light["indoor"] = layers.aovs.indoor
    # Glare is linear, so it can be added to each layer.
    light = {name: add_glare(layer, tone.glare) for name, layer in light.items()}
    # Move typical radiance to the middle of the range of half floats.
    total = np.asarray(sum(light.values()), np.float32)
    scale = scale_of(exposure_of(total, tone), float(total.max(initial=0.0)))
    planes = {"albedo": layers.aovs.albedo} | {k: v * np.float32(scale) for k, v in light.items()}
    facts = {"scale": scale, "tone": _tone_facts(tone), "denoised": denoise, "lamps": rows}
    return packet(planes, facts)


def packet(planes: Mapping[str, NDArray[np.float32]], facts: Mapping[str, Any]) -> bytes:
    """The packet of (H, W, 3) float32 planes of one size, with facts in its JSON.

    Negative values and NaN become 0, larger values than a half float its largest.
    """
    height, width = next(iter(planes.values())).shape[:2]
    described = {"width": width, "height": height, "planes": list(planes), **facts}
    text = json.dumps(described, allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    halves = [
        np.clip(np.nan_to_num(plane, posinf=_LARGEST), 0, _LARGEST).astype("<f2").tobytes()
        for plane in planes.values()
    ]
    return b"".join((MAGIC, struct.pack("<I", len(text)), text, *halves))


def scale_of(exposure: float, largest: float) -> float:
    """The power of two nearest to the exposure that keeps the largest radiance a half float.

    exposure is positive; largest is the maximum of the sum of all planes, 0 for a black picture.
    """
    power = round(math.log2(exposure))
    if largest > 0:
        power = min(power, math.floor(math.log2(_LARGEST / largest)))
    return float(2.0**power)


def lamp_rows(view_json: bytes) -> list[dict[str, Any]]:
    """A row for each lamp of view.json, with printable names; [] without valid rows."""
    try:
        rows = json.loads(view_json)["modes"]["light"]["lamps"]
        return [
            {
                "number": int(r["number"]),
                "name": shown(r.get("name") or r["item"]),
                "room": shown(r.get("room") or ""),
                "lm": float(r["lm"]),
                "share": float(r["share"]),
                "layer": str(r["layer"]) if r["layer"] else None,
            }
            for r in rows
        ]
    except (ValueError, KeyError, TypeError, RecursionError):
        return []


def _tone_of(view_json: bytes, recipe: bytes) -> ToneFields:
    """The tone that the recipe draws for the view."""
    try:
        row = json.loads(view_json)
        house, view = str(row["house"]), str(row["view"])
    except (ValueError, KeyError, TypeError, RecursionError):
        raise BadInput("view.json", "", "is not the folder of a view") from None
    return recipe_from_json(recipe, "recipe.json").camera_of(house, view).tone


def _tone_facts(tone: ToneFields) -> dict[str, Any]:
    from pbrs_farm.transport.develop.tone_mapping import knee_of

    shown = {
        "preset", "key", "white_balance", "exposure_ev", "contrast", "flare", "warmth_ev", "tint_ev", "white",
    }  # fmt: skip
    return tone.model_dump(include=shown) | {"knee": knee_of(tone.white)}


def _view_files(data: bytes) -> tuple[Sequence[bytes], bool]:
    n_radiance, n_view, n_recipe, denoise = _HEAD.unpack_from(data)
    start, parts = _HEAD.size, []
    for n in (n_radiance, n_view, n_recipe):
        parts.append(data[start : start + n])
        start += n
    return parts, denoise


def main() -> int:
    """Read a view's files from stdin, write its packet to stdout."""
    (radiance, view_json, recipe), denoise = _view_files(sys.stdin.buffer.read())
    try:
        sys.stdout.buffer.write(light_packet(radiance, view_json, recipe, denoise=denoise))
    except PbrsError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
