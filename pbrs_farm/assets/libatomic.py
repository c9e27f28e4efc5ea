"""GCC's libatomic, which Dr.Jit and LLVM's wheel are linked with and bare systems lack.

Effects: loads it into this process: the system's, else that of Debian's package, which is downloaded once
(9 KB) as debian.py does and kept, unpacked, in the cache folder.
"""

from __future__ import annotations

import ctypes
import platform
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Final

from pbrs_farm.core.errors import MachineFailed
from pbrs_farm.installation import system_command

if TYPE_CHECKING:
    from pbrs_farm.assets.debian import Deb

NAME: Final = "libatomic.so.1"
PACKAGE: Final = "libatomic1"
TESTED_VERSION: Final = "12.2.0-14+deb12u1"


def load_libatomic() -> None:
    """Load libatomic for libraries loaded afterwards; only on Linux.

    Raises MachineFailed, with what to do, if neither the system nor Debian has it.
    """
    if sys.platform != "linux":
        return
    try:
        ctypes.CDLL(NAME)
    except OSError:
        _load(unpacked_library(_package()))


def _package() -> Deb:
    from pbrs_farm.assets.debian import fetched_deb

    try:
        return fetched_deb(PACKAGE, TESTED_VERSION)
    except MachineFailed as error:
        text = f"this system has no libatomic, which Dr.Jit needs: {error.message}"
        hint = f"{system_command('atomic')}; or {error.hint}"
        raise MachineFailed(text, hint=hint) from None


def unpacked_library(deb: Deb) -> Path:
    """Unpack the library of a package beside it in the cache; MachineFailed if the package has none."""
    from pbrs_farm.assets.debian import write_whole

    library = deb.path.parent / f"{PACKAGE}-{deb.sha256[:16]}" / NAME
    if not library.exists():
        files = deb.members(lambda name: name.rpartition("/")[2].startswith(f"{NAME}."))
        if not files:
            raise deb.damaged(f"has no {NAME}")
        library.parent.mkdir(exist_ok=True)
        write_whole(library, next(iter(files.values())))
    return library


def _load(library: Path) -> None:
    # Once it is loaded, the linker finds it by the name that it has itself.
    try:
        ctypes.CDLL(str(library))
    except OSError as error:
        text = f"{error}; Debian's file is for x86-64, this machine is {platform.machine()}"
        raise MachineFailed(text, hint=system_command("atomic")) from None
