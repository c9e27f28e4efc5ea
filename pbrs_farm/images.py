"""Convert between pixel arrays and PNG, EXR or JPEG bytes; the only user of OpenImageIO.

Effects: one temporary file per call, as the binding only handles files. Written files are in memory
(on disk a small PNG took 5 ms), read files on disk. EXR channels are found by name, never by position
(OpenEXR sorts them). EXR files have a fixed DateTime, so equal images give equal bytes.
"""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32
from pbrs_farm.core.errors import BadInput, MachineFailed
from pbrs_farm.core.file_kinds import kind_of
from pbrs_farm.operating_system import OPEN_FILES, memory_file


class _AtFirstUse:
    # OpenImageIO starts a thread when it is loaded, so a process that has loaded it is not forked.
    def __getattr__(self, name: str) -> Any:
        import OpenImageIO

        return getattr(OpenImageIO, name)


oiio: Final = _AtFirstUse()

MAX_FILE_PIXELS: Final = 16384 * 16384  # larger pictures are rejected before their pixels are read

_FIXED_DATE: Final = "2000:01:01 00:00:00"  # DateTime of all EXR files, for equal bytes

# (libpng filter, zlib level), the best of 24 measured on synthetic 640x480 pictures. Labels use the
# UP filter: 16-bit depth takes 10 kB and a third of the time of libpng's default choice of filter
# (17 kB), normals 4 kB and half of its time. Photographs use AVG: noise of 3 levels takes 536 kB
# and a fifth of its time (535 kB).
_PNG_LABELS: Final = (32, 4)
_PNG_PHOTO: Final = (64, 2)

# First bytes -> file type.
_MAGIC: Final = (
    (b"\x89PNG\r\n\x1a\n", ".png"),
    (b"\xff\xd8\xff", ".jpg"),
    (b"GIF8", ".gif"),
    (b"BM", ".bmp"),
    (b"\x76\x2f\x31\x01", ".exr"),
    (b"#?", ".hdr"),
)
_RESOLUTION: Final = re.compile(rb"\n\r?\n([+-])([XY]) +[0-9]+ +([+-])[XY] +[0-9]+\r?\n")
_HDR_HEADER_BYTES: Final = 65_536  # maximum header size of a Radiance picture
_TEXTURE_KINDS: Final = (".png", ".jpg", ".gif", ".bmp", ".tga")


def png_from_array(
    array: NDArray[np.uint8] | NDArray[np.uint16],
    *,
    attribution: str = "",
    texts: Mapping[str, str] | None = None,
) -> bytes:
    """PNG bytes of (H, W) or (H, W, 3 or 4) uint8 or uint16, without an added alpha or timestamp.

    8-bit colour is tagged as sRGB, everything else as data. attribution: the file's copyright. texts: keyword
    -> value of further text chunks.
    """
    channels = _channels(array, (1, 3, 4))
    if array.dtype not in (np.uint8, np.uint16):
        raise ValueError(f"a PNG holds uint8 or uint16, got {array.dtype}")
    is_photo = channels >= 3 and array.dtype == np.uint8
    png_filter, level = _PNG_PHOTO if is_photo else _PNG_LABELS
    spec = oiio.ImageSpec(array.shape[1], array.shape[0], channels, str(array.dtype))
    spec["oiio:ColorSpace"] = "sRGB" if is_photo else "data"
    spec["png:filter"] = png_filter
    spec["png:compressionLevel"] = level
    spec["oiio:UnassociatedAlpha"] = 1  # store colours without multiplying them by alpha
    if attribution:
        spec["Copyright"] = attribution
    for keyword, value in (texts or {}).items():
        spec[keyword] = value
    return _encoded(array, spec, ".png")


def jpeg_from_array(array: NDArray[np.uint8], quality: int = 85) -> bytes:
    """JPEG bytes of (H, W) or (H, W, 3) uint8 sRGB; quality 1..100.

    For pictures to look at, never for labels, as JPEG is lossy. Equal arrays give equal bytes on one
    machine. Raises ValueError for another shape or type.
    """
    channels = _channels(array, (1, 3))
    if array.dtype != np.uint8:
        raise ValueError(f"a JPEG holds uint8, got {array.dtype}")
    spec = oiio.ImageSpec(array.shape[1], array.shape[0], channels, "uint8")
    spec["Compression"] = f"jpeg:{quality}"
    return _encoded(array, spec, ".jpg")


def thumbnail(
    array: NDArray[np.uint8], *, max_edge_px: int, nearest: bool = False
) -> NDArray[np.uint8]:
    """Shrink (H, W) or (H, W, C) uint8 so that its longer edge is at most max_edge_px; never enlarges.

    nearest: pick pixels instead of averaging them, for labels and their colours.
    """
    height, width = array.shape[:2]
    scale = min(1.0, max_edge_px / max(height, width))
    size = max(1, round(width * scale)), max(1, round(height * scale))
    return resized(array, *size, nearest=nearest)


def resized(
    array: NDArray[np.uint8], width_px: int, height_px: int, *, nearest: bool = False
) -> NDArray[np.uint8]:
    """Resample (H, W) or (H, W, C) uint8 to width_px x height_px with a box filter.

    The aspect ratio may change. nearest: pick the pixel with the nearest centre, which preserves the
    values of labels.
    """
    height, width = array.shape[:2]
    if (height, width) == (height_px, width_px):
        return array
    if nearest:
        rows = (np.arange(height_px) + 0.5) * height / height_px
        columns = (np.arange(width_px) + 0.5) * width / width_px
        return np.asarray(array[rows.astype(np.intp)[:, None], columns.astype(np.intp)])
    channels = _channels(array, (1, 3, 4))
    source = oiio.ImageBuf(np.ascontiguousarray(array).reshape(height, width, channels))
    target = oiio.ImageBuf(oiio.ImageSpec(width_px, height_px, channels, "uint8"))
    if not oiio.ImageBufAlgo.resize(target, source, filtername="box"):
        raise MachineFailed(f"OpenImageIO cannot resize: {target.geterror()}")
    pixels = np.asarray(target.get_pixels("uint8"), np.uint8)
    return pixels.reshape(height_px, width_px, *array.shape[2:])


def exr_from_layers(
    layers: Mapping[str, F32], *, half: bool = False, attribution: str = ""
) -> bytes:
    """OpenEXR bytes of named channels ("outdoor.R": (H, W) float32), all of one size.

    half: 16-bit floats instead of 32. attribution: the file's copyright. All channels have one type.
    """
    if not layers:
        raise ValueError("an EXR needs at least one layer")
    # Sort channels like OpenEXR, so that files do not depend on the order of layers.
    names = sorted(layers)
    shapes = {layers[name].shape for name in names}
    if len(shapes) != 1 or any(len(shape) != 2 for shape in shapes):
        raise ValueError(f"layers of one (H, W) wanted, got {sorted(shapes)}")
    pixels = np.stack([np.asarray(layers[name], np.float32) for name in names], axis=-1)
    height, width = pixels.shape[:2]
    spec = oiio.ImageSpec(width, height, len(names), "half" if half else "float")
    spec.channelnames = tuple(names)
    spec["Compression"] = "zip"
    spec["DateTime"] = _FIXED_DATE
    if attribution:
        spec["Copyright"] = attribution
    return _encoded(pixels, spec, ".exr")


def layers_from_exr(data: bytes, name: str = "radiance.exr") -> dict[str, F32]:
    """Channel name -> (H, W) float32 of an OpenEXR file.

    Half floats become float32. Address channels by name ("outdoor.R"), as OpenEXR sorts them. Raises
    BadInput with the file's name if it is damaged or not an EXR.
    """
    if _kind(data, name) != ".exr":
        raise _not_a("an OpenEXR file", data, name)
    pixels, spec = _decoded(data, name, ".exr", "float")
    return {
        channel: np.ascontiguousarray(pixels[..., i]) for i, channel in enumerate(spec.channelnames)
    }


def array_from_png(
    data: bytes, name: str = "picture.png"
) -> NDArray[np.uint8] | NDArray[np.uint16]:
    """The pixels as stored in the PNG: (H, W) or (H, W, C), uint8 or uint16.

    For labels: keeps 16 bits, converts no colours and does not multiply by alpha. Use decode_photo or
    decode_texture for photographs and textures. name: for messages. Raises BadInput for other formats,
    damaged data, and more than MAX_FILE_PIXELS.
    """
    if _kind(data, name) != ".png":
        raise _not_a("a PNG file", data, name)
    pixels, _spec = _decoded(data, name, ".png", "unknown")
    if pixels.dtype not in (np.uint8, np.uint16):
        raise BadInput(name, "", f"expected 8 or 16 bits, got {pixels.dtype}")
    return pixels[..., 0] if pixels.shape[2] == 1 else pixels


def decode_photo(data: bytes, name: str) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 sRGB of a PNG, JPEG, GIF, BMP or TGA; alpha is dropped.

    Like decode_texture: 16 bits become 8, grey is repeated. Raises BadInput with the file's name.
    """
    return decode_texture(data, name)[..., :3]


def decode_texture(data: bytes, name: str, media_type: str = "") -> NDArray[np.uint8]:
    """(H, W, 3) or (H, W, 4) uint8 sRGB, row 0 = top, of a PNG, JPEG, GIF, BMP or TGA.

    The type is detected from the bytes; for TGA, which has no signature, from name or media_type. Grey
    is repeated to three channels; alpha is not multiplied into the colours, and dropped if fully
    opaque. EXIF orientation is ignored. Raises BadInput with the file's name.
    """
    kind = _kind(data, f"{name} {media_type}".strip())
    if kind not in _TEXTURE_KINDS:
        raise _not_a("a PNG, JPEG, GIF, BMP or TGA picture", data, name)
    pixels, spec = _decoded(data, name, kind, "uint8")
    # Separate alpha from colour; drop it if it is opaque everywhere.
    channels = pixels.shape[2]
    if channels in (2, 4) and (spec.alpha_channel >= 0 or channels == 4):
        colour, alpha = pixels[..., :-1], pixels[..., -1:]
        colour = np.repeat(colour, 3, axis=2) if channels == 2 else colour
        if int(alpha.min()) == 255:
            return np.ascontiguousarray(colour)
        return np.concatenate([colour, alpha], axis=2)
    if channels in (1, 2):
        return np.repeat(pixels[..., :1], 3, axis=2)
    return np.ascontiguousarray(pixels[..., :3])


def decode_radiance(data: bytes, name: str) -> F32:
    """(H, W, 3) float32 linear of a Radiance .hdr or OpenEXR panorama; BadInput if unreadable.

    Values are not scaled or clipped. Channels are found by the names R, G and B; others are dropped.
    Row 0 is the top, whatever the orientation of the .hdr.
    """
    kind = _kind(data, name)
    if kind not in (".hdr", ".exr"):
        raise _not_a("a Radiance HDR or OpenEXR picture", data, name)
    pixels, spec = _decoded(data, name, kind, "float")
    # Find R, G and B by name: OpenEXR sorts channels.
    names = list(spec.channelnames)
    if all(channel in names for channel in "RGB"):
        pixels = pixels[..., [names.index(channel) for channel in "RGB"]]
    elif pixels.shape[2] != 3:
        raise BadInput(name, "", f"expected channels R, G and B, got {', '.join(names)}")
    return np.ascontiguousarray(_upright(pixels, data) if kind == ".hdr" else pixels)


def _not_a(wanted: str, data: bytes, name: str) -> BadInput:
    kind = kind_of(data)
    text = f"not {wanted}" if kind is None else f"is {kind.words}, not {wanted}"
    return BadInput(name, "", text, hint="" if kind is None else kind.hint)


def _upright(scanlines: NDArray[Any], data: bytes) -> NDArray[Any]:
    """Flip and transpose a Radiance picture's scanlines to rows from the top, columns from the left.

    The line before the pixels gives their order ("-Y 64 +X 128" from the top, "+Y" from below,
    "+X ... -Y" by columns), x to the right and y up (Ward, Radiance file formats).
    """
    match = _RESOLUTION.search(data[:_HDR_HEADER_BYTES])
    if match is None:
        return scanlines
    first, axis, second = match.groups()
    if axis == b"Y":
        rows = scanlines[::-1] if first == b"+" else scanlines
        return rows[:, ::-1] if second == b"-" else rows
    columns = scanlines[::-1] if first == b"-" else scanlines
    return (columns[:, ::-1] if second == b"+" else columns).swapaxes(0, 1)


def _channels(array: NDArray[Any], allowed: tuple[int, ...]) -> int:
    channels = 1 if array.ndim == 2 else array.shape[2] if array.ndim == 3 else 0
    if channels not in allowed or 0 in array.shape:
        raise ValueError(f"a picture is (H, W) or (H, W, C), C in {allowed}; got {array.shape}")
    return channels


def _kind(data: bytes, name: str) -> str:
    for magic, suffix in _MAGIC:
        if data.startswith(magic):
            return suffix
    return ".tga" if name.lower().endswith((".tga", "tga", "targa")) else ""


@contextmanager
def _temporary(suffix: str, data: bytes | None = None) -> Iterator[Path]:
    handle, text = tempfile.mkstemp(suffix=suffix, prefix="pbrs-image-")
    path = Path(text)
    try:
        with os.fdopen(handle, "wb") as file:
            if data is not None:
                file.write(data)
        yield path
    finally:
        path.unlink(missing_ok=True)


@contextmanager
def _scratch(suffix: str) -> Iterator[Path]:
    """An empty file in memory if the system supports it, since a file on disk would be written out."""
    handle = memory_file("pbrs-image")
    if handle is None:
        with _temporary(suffix) as path:
            yield path
        return
    try:
        yield OPEN_FILES / str(handle)
    finally:
        os.close(handle)


def _encoded(array: NDArray[Any], spec: Any, suffix: str) -> bytes:
    with _scratch(suffix) as path:
        output = oiio.ImageOutput.create(f"picture{suffix}")
        if output is None:
            raise MachineFailed(f"OpenImageIO cannot write {suffix}: {oiio.geterror()}")
        # The binding interprets a 2D array as a row of pixels, so add a channel axis.
        pixels = np.ascontiguousarray(array).reshape(spec.height, spec.width, spec.nchannels)
        written = output.open(str(path), spec) and output.write_image(pixels)
        closed = output.close()
        if not (written and closed):
            text = f"OpenImageIO cannot write {suffix}: {output.geterror()}"
            is_in_memory = path.parent == OPEN_FILES
            hint = "is there memory left?" if is_in_memory else f"is there room for {path}?"
            raise MachineFailed(text, hint=hint)
        return path.read_bytes()


def _decoded(data: bytes, name: str, suffix: str, kind: str) -> tuple[NDArray[Any], Any]:
    """(H, W, C) array of type kind ("unknown": as stored) and the file's ImageSpec."""
    if suffix == ".png" and _is_cut_short(data):  # raised here, as libpng would write to stderr
        raise BadInput(name, "", "cannot be read as a picture: damaged or truncated")
    # Read alpha without multiplying it into the colours.
    config = oiio.ImageSpec()
    config["oiio:UnassociatedAlpha"] = 1
    with _temporary(suffix, data) as path:
        source = oiio.ImageInput.open(str(path), config)
        if source is None:
            raise BadInput(name, "", _reason(oiio.geterror(), path))
        try:
            spec = source.spec()
            if spec.width * spec.height > MAX_FILE_PIXELS:
                raise BadInput(name, "", f"{spec.width}x{spec.height} pixels are too many")
            pixels = source.read_image(0, 0, 0, spec.nchannels, kind)
            fault = source.geterror()  # a truncated file gives pixels and an error
        finally:
            source.close()
    if pixels is None or fault:
        raise BadInput(name, "", _reason(fault, path))
    return pixels, spec


def _is_cut_short(png: bytes) -> bool:
    """True if a chunk of the PNG is longer than the rest of the file."""
    position = 8  # after the signature
    while position < len(png):
        # Chunk: length, type, data, checksum.
        end = position + 12 + int.from_bytes(png[position : position + 4], "big")
        if end > len(png):
            return True
        if png[position + 4 : position + 8] == b"IEND":
            return False
        position = end
    return position == 8


def _reason(fault: str, path: Path) -> str:
    # Hide the temporary file's name from the user.
    text = " ".join(fault.replace(str(path), "it").split())
    return f"cannot be read as a picture: {text or 'damaged or truncated'}"
