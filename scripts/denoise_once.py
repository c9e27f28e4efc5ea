"""Prints the SHA-256 of a picture by Open Image Denoise, called as pbrs_farm calls it.

python scripts/denoise_once.py .../pyoidn/oidn/lib/libOpenImageDenoise.so

Needs only the library, so that libraries packed for one Python can be tried with another.
The picture is noise of 64x48; effects: threads of the denoiser. Exits 1 with the denoiser's error.
"""

from __future__ import annotations

import hashlib
import random
import sys
from array import array
from ctypes import CDLL, POINTER, byref, c_bool, c_char_p, c_int, c_size_t, c_void_p
from typing import Any, Final

SIZE: Final = (64, 48)
_CPU: Final = 1
_FLOAT3: Final = 3
_HIGH: Final = 6
# The used functions of OpenImageDenoise/oidn.h: types of results and arguments.
_CALLS: Final[dict[str, tuple[Any, list[Any]]]] = {
    "oidnNewDevice": (c_void_p, [c_int]),
    "oidnCommitDevice": (None, [c_void_p]),
    "oidnGetDeviceError": (c_int, [c_void_p, POINTER(c_char_p)]),
    "oidnNewFilter": (c_void_p, [c_void_p, c_char_p]),
    "oidnSetSharedFilterImage": (None, [c_void_p, c_char_p, c_void_p, c_int, *[c_size_t] * 5]),
    "oidnSetFilterBool": (None, [c_void_p, c_char_p, c_bool]),
    "oidnSetFilterInt": (None, [c_void_p, c_char_p, c_int]),
    "oidnCommitFilter": (None, [c_void_p]),
    "oidnExecuteFilter": (None, [c_void_p]),
}


def main(path: str) -> None:
    """Denoise one picture on the CPU."""
    library = CDLL(path)
    for function, (result, arguments) in _CALLS.items():
        call = getattr(library, function)
        call.restype, call.argtypes = result, arguments
    device = library.oidnNewDevice(_CPU)
    library.oidnCommitDevice(device)
    denoiser = library.oidnNewFilter(device, b"RT")

    noise = random.Random(1)
    images = {
        name: array("f", (noise.random() for _ in range(3 * SIZE[0] * SIZE[1])))
        for name in (b"color", b"albedo", b"normal", b"output")
    }
    for name, image in images.items():
        start, _n = image.buffer_info()
        library.oidnSetSharedFilterImage(denoiser, name, start, _FLOAT3, *SIZE, 0, 0, 0)
    library.oidnSetFilterBool(denoiser, b"hdr", True)
    library.oidnSetFilterBool(denoiser, b"cleanAux", True)
    library.oidnSetFilterInt(denoiser, b"quality", _HIGH)
    library.oidnCommitFilter(denoiser)
    library.oidnExecuteFilter(denoiser)

    text = c_char_p()
    if library.oidnGetDeviceError(device, byref(text)):
        sys.exit(f"denoise_once: {(text.value or b'').decode()}")
    sys.stdout.write(hashlib.sha256(images[b"output"].tobytes()).hexdigest() + "\n")


if __name__ == "__main__":
    main(sys.argv[1])
