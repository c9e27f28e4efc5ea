"""A pack: the files of a view's steps as one object, and the object of each key; no effects."""

from __future__ import annotations

import io
import json
import tarfile
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from pbrs_farm.core import keys
from pbrs_farm.core.errors import StoreFailed

_INDEX: Final = "index.json"

FORMAT: Final = 1  # version of layout.json and of packs; a reader refuses a later one

# Group -> steps of a view written together.
GROUPS: Final = {
    "labels": ("truth", "opengl_dl", "opengl_il"),
    "light": ("light",),
    "pictures": ("develop", "view"),
}
GROUP_OF_STEP: Final = {step: group for group, steps in GROUPS.items() for step in steps}
TAR_BLOCK: Final = 512


@dataclass(frozen=True, slots=True)
class Pack:
    """The index of a pack, and the first bytes read with it."""

    rows: Mapping[str, tuple[str, int, int]]  # name -> step, first byte, number of bytes
    head: bytes

    def held(self, name: str) -> bytes | None:
        """The bytes of a member of `rows` (or KeyError); None if beyond `head`: read its range of the object."""
        _step, start, n_bytes = self.rows[name]
        end = start + n_bytes
        return self.head[start:end] if end <= len(self.head) else None


def pack_bytes(steps: Mapping[str, Mapping[str, bytes]]) -> bytes:
    """Pack the results of steps as a tar: step -> name below the view's folder, or of its marker -> bytes.

    Markers come first and then the smallest members, so that one read of the beginning shows the
    steps done. Bytes depend on the members alone (no times, no owners): equal steps give equal packs.
    An ordinary `tar` opens it.
    """
    files = [
        (name, step, data) for step, members in steps.items() for name, data in members.items()
    ]
    files.sort(key=lambda row: (not row[0].startswith("done/"), len(row[2]), row[0]))
    # Offsets count from the end of the index, so its length does not depend on them.
    rows, offset = [], 0
    for name, step, data in files:
        offset += TAR_BLOCK
        rows.append([name, step, offset, len(data)])
        offset += _padded(len(data))
    index = json.dumps({"format": FORMAT, "members": rows}, separators=(",", ":")).encode()
    out = io.BytesIO()
    with tarfile.open(fileobj=out, mode="w", format=tarfile.USTAR_FORMAT) as tar:
        for name, data in [(_INDEX, index), *((name, data) for name, _step, data in files)]:
            entry = tarfile.TarInfo(name)
            entry.size = len(data)
            tar.addfile(entry, io.BytesIO(data))
    return out.getvalue()


def pack_from_head(data: bytes, key: str) -> Pack | None:
    """The pack that begins with data; None if its index is longer. StoreFailed for any other object.

    data: the first bytes of the object; key: for messages. If None, read more and call again. Raises
    StoreFailed for a later version of the format, too.
    """
    try:
        entry = tarfile.TarInfo.frombuf(data[:TAR_BLOCK], "ascii", "strict")
        if entry.name != _INDEX:
            raise ValueError(entry.name)
        base = TAR_BLOCK + _padded(entry.size)
        if len(data) < TAR_BLOCK + entry.size:
            return None
        index = json.loads(data[TAR_BLOCK : TAR_BLOCK + entry.size])
        if index["format"] != FORMAT:
            raise StoreFailed(key, "written by a newer pbrs_farm", hint="install that version")
        rows = {
            str(n): (str(step), base + int(offset), int(size))
            for n, step, offset, size in index["members"]
        }
    except (tarfile.HeaderError, ValueError, KeyError, TypeError):
        raise StoreFailed(
            key, "is not a pack of a view", hint="remove it to make it again"
        ) from None
    return Pack(rows, data)


def _padded(n_bytes: int) -> int:
    return -(-n_bytes // TAR_BLOCK) * TAR_BLOCK


def marker_of(step: str) -> str:
    """Name of a step's marker in a pack."""
    return f"done/{step}.json"


def house_folder(house: str) -> str:
    """Folder of a house or object in a packed root, below two hex digits of the id's sha256."""
    top = keys.FOLDERS[keys.is_object(house)]
    return f"{top}/{keys.sha256(house.encode())[:2]}/{house}/"


def pack_key(house: str, view: str, group: str) -> str:
    """Key of the pack of a view's group of steps (a key of GROUPS), or of a step with its own pack."""
    return f"{house_folder(house)}packs/{group}.{view}.tar"


def object_key(key: str) -> str:
    """The object of a key outside views, houses spread by `house_folder`; inverse: `key_of_object`."""
    top, _, rest = key.partition("/")
    house, slash, below = rest.partition("/")
    return f"{house_folder(house)}{below}" if top in keys.FOLDERS and slash else key


def key_of_object(found: str) -> str:
    top, _, rest = found.partition("/")
    return f"{top}/{rest.partition('/')[2]}" if top in keys.FOLDERS else found


def file_or_marker(at: keys.HouseKey) -> str:
    return marker_of(at.step) if at.step else at.file


def groups_of(at: keys.HouseKey) -> tuple[str, ...]:
    """The groups that may contain a view's file or marker, the likeliest first."""
    if at.step:
        return (GROUP_OF_STEP.get(at.step, at.step),)
    if at.file == "radiance.exr":
        return ("light",)
    if at.file in ("view.json", "histogram.json") or at.file.startswith("mlt_"):
        return ("pictures",)
    return ("labels", "pictures", "light")  # plugins write layers and pictures of any name


def steps_of(at: keys.HouseKey, group: str) -> tuple[str, ...]:
    """Steps of a group whose own packs may contain files missing in its pack; for a marker only its own step."""
    steps = (at.step,) if at.step else GROUPS[group]
    return tuple(step for step in steps if step != group)
