"""Files that a MuJoCo model references, checked, as MuJoCo opens them itself. Reads its XML files."""

from __future__ import annotations

import posixpath
from typing import Final
from xml.etree.ElementTree import Element, ParseError

from defusedxml import DefusedXmlException
from defusedxml.ElementTree import fromstring

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.read.common.format import GivenFile, root_of
from pbrs_farm.read.common.source_files import RootFolder, SourceFiles

MAX_XML_BYTES: Final = 128 * 2**20
_MOST_FILES: Final = 20_000
_MODELS: Final = ("include", "model")  # elements whose file is XML, too
_FOLDERS: Final = ("meshdir", "texturedir", "assetdir")


def files_of_model(folder: RootFolder, name: str) -> set[str]:
    """Names below the root of a model's existing files; BadHouse for bad XML or a name outside the root."""
    names_read: set[str] = set()
    waiting = [(name, "")]  # with the folder that included files are named from
    while waiting:
        file_name, base = waiting.pop()
        if file_name in names_read:
            continue
        names_read.add(file_name)
        if len(names_read) > _MOST_FILES:
            raise BadHouse(name, "", f"names more than {_MOST_FILES} files")
        root = _parsed(folder, file_name)
        parent = base or posixpath.dirname(file_name)
        compilers = list(root.iter("compiler"))
        named = [str(c.get(key)) for c in compilers for key in _FOLDERS if c.get(key)]
        folders = [parent, *(posixpath.join(parent, subfolder) for subfolder in named)]
        for row in root.iter():
            file = row.get("file")
            if not file:
                continue
            is_model = row.tag in _MODELS
            names = [
                _below(folder, f, file, file_name) for f in (folders[:1] if is_model else folders)
            ]
            existing = [n for n in names if folder.path(n) is not None]
            if is_model:
                # File names in an included file are relative to the including one.
                waiting += [(n, parent if row.tag == "include" else "") for n in existing]
            else:
                names_read |= set(existing)
    return names_read


def companions_of_mjcf(given: GivenFile, files: SourceFiles) -> str:
    """Digest of all other files of the model; "" if there are none."""
    folder, name = root_of(given)
    stem = name.rsplit(".", 1)[0]
    beside = {f"{stem}.classes.json", f"{stem}.rooms.json"}
    return files.digest(folder, (files_of_model(folder, name) | beside) - {name})


def _below(folder: RootFolder, at: str, file: str, own: str) -> str:
    try:
        return folder.name_from(at, file)
    except BadHouse:
        hint = "give a common parent folder: --models FOLDER"
        raise BadHouse(own, f"file={file[:80]!r}", "leads out of its folder", hint=hint) from None


def _parsed(folder: RootFolder, name: str) -> Element:
    data = folder.read(name, max_bytes=MAX_XML_BYTES)
    if data is None:
        raise BadHouse(name, "", "no such file")
    try:
        root: Element = fromstring(data, forbid_dtd=True)
    except (ParseError, DefusedXmlException, ValueError, LookupError, RecursionError) as error:
        raise BadHouse(name, "", f"is not valid XML: {str(error)[:100]}") from None
    if not name.endswith(".urdf") and root.tag not in ("mujoco", "mujocoinclude"):
        raise BadHouse(name, "", f"begins with <{str(root.tag)[:40]}>, not <mujoco>")
    return root
