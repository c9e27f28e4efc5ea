"""Archives and XML that attack their reader: bombs, false sizes, other encodings. No effects until written."""

from __future__ import annotations

import io
import struct
import warnings
import zipfile
from collections.abc import Iterator
from functools import partial

from tests.hostile.case import Case, by_verb, home
from tests.hostile.sound_inputs import CHAIRS, MODELS, XML, archive, zip_of
from tests.read.sweethome3d.sh3d_source import WALLS

_HEAD = "<?xml version='1.0'?>"


def cases() -> Iterator[Case]:
    """Zip archives, then XML."""
    for name, data in _archives().items():
        yield home(f"zip/{name}", "format", "bad.sh3d", data)
    yield home("zip/bomb_home_xml", "bounds", "bad.sh3d", partial(_bomb, "Home.xml"))
    yield home("zip/bomb_model", "bounds", "bad.sh3d", partial(_bomb, "1"))
    yield home("zip/bomb_overlapping", "bounds", "bad.sh3d", _overlapping_entries)
    yield home("zip/many_entries", "bounds", "bad.sh3d", _many_entries)
    for name, xml in _xml().items():
        yield home(f"xml/{name}", "format", "bad.sh3d", zip_of({"Home.xml": xml} | MODELS))
    yield home("xml/many_attributes", "bounds", "bad.sh3d", partial(_of_xml, _attributes()))
    yield home("xml/comment_15_mb", "bounds", "bad.sh3d", partial(_of_xml, _comment()))
    yield home("xml/bare", "format", "bad.xml", XML)
    yield by_verb("zip/repair_cut", "format", "repair", "bad.sh3d", archive()[:500])
    yield by_verb("xml/cameras_bomb", "format", "cameras", "bad.xml", _laughs())


def _archives() -> dict[str, bytes]:
    sound = archive()
    encrypted = bytearray(sound)
    for start in (sound.find(b"PK\x03\x04") + 6, sound.find(b"PK\x01\x02") + 8):
        encrypted[start] |= 1
    method = bytearray(sound)
    for start in (sound.find(b"PK\x03\x04") + 8, sound.find(b"PK\x01\x02") + 10):
        method[start : start + 2] = struct.pack("<H", 99)
    checksum = bytearray(sound)
    checksum[sound.find(b"PK\x01\x02") + 16] ^= 255
    size = bytearray(sound)
    start = sound.find(b"PK\x01\x02") + 24
    size[start : start + 4] = struct.pack("<I", 10)
    return {
        "cut_half": sound[: len(sound) // 2],
        "cut_100_bytes": sound[:100],
        "cut_directory": sound[:-30],
        "no_home": zip_of(MODELS),
        "binary_home": zip_of({"Home": b"\xac\xed\x00\x05sr\x00\x04Home"} | MODELS),
        "encrypted": bytes(encrypted),
        "unknown_method": bytes(method),
        "wrong_checksum": bytes(checksum),
        "wrong_size": bytes(size),
        "home_twice": _twice(),
        "noise": bytes(range(256)) * 400,
        "only_pk": b"PK\x03\x04",
        "empty_archive": zip_of({}),
        "home_is_folder": zip_of({"Home.xml/": b"", "Home.xml/a": b""}),
        "in_itself": zip_of({"Home.xml": archive()}),
        "stored_lzma": _other_method(zipfile.ZIP_LZMA),
    }


def _twice() -> bytes:
    stream = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(stream, "w") as file:
        warnings.simplefilter("ignore")
        file.writestr("Home.xml", XML)
        file.writestr("Home.xml", b"<home/>")
    return stream.getvalue()


def _other_method(method: int) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", method) as file:
        for name, data in ({"Home.xml": XML} | MODELS).items():
            file.writestr(name, data)
    return stream.getvalue()


def _bomb(entry: str) -> bytes:
    """An entry that unpacks to 400 MB."""
    return zip_of({"Home.xml": XML} | MODELS | {entry: b" " * 400_000_000})


def _many_entries() -> bytes:
    return zip_of({"Home.xml": XML} | MODELS | {f"{k}": b"" for k in range(2, 60_000)})


def _overlapping_entries() -> bytes:
    """5,000 names that share the bytes of one entry of 10 MB."""
    sound = zip_of({"Home.xml": XML, "1": b"#" * 10_000_000})
    start = sound.find(b"PK\x01\x02", sound.find(b"PK\x01\x02") + 4)
    end = sound.find(b"PK\x05\x06")
    record = bytearray(sound[start:end])
    record[28:30] = struct.pack("<H", 5)
    names = [record[:46] + f"{k:05}".encode() for k in range(5000)]
    directory = sound[sound.find(b"PK\x01\x02") : end] + b"".join(map(bytes, names))
    tail = struct.pack(
        "<4s4H2IH", b"PK\x05\x06", 0, 0, 5002, 5002, len(directory), sound.find(b"PK\x01\x02"), 0
    )
    return sound[: sound.find(b"PK\x01\x02")] + directory + tail


def _of_xml(xml: bytes) -> bytes:
    return zip_of({"Home.xml": xml} | MODELS)


def _xml() -> dict[str, bytes]:
    text = XML.decode()
    body = text.removeprefix(_HEAD)
    latin = body.replace("Hall", "Küche")
    quadratic = "&a;" * 1000
    return {
        "empty": b"",
        "cut": XML[: len(XML) // 2],
        "laughs": _laughs(),
        "quadratic": (
            f"{_HEAD}<!DOCTYPE home [<!ENTITY a '{'x' * 100_000}'>]><home name='{quadratic}'/>"
        ).encode(),
        "external_entity": (
            f"{_HEAD}<!DOCTYPE home [<!ENTITY a SYSTEM 'file:///etc/passwd'>]><home>&a;</home>"
        ).encode(),
        "external_dtd": (
            f"{_HEAD}<!DOCTYPE home SYSTEM 'http://127.0.0.1:9/a.dtd'>{body}"
        ).encode(),
        "deep_100_000": (
            f"{_HEAD}<home>{'<furnitureGroup>' * 100_000}{'</furnitureGroup>' * 100_000}</home>"
        ).encode(),
        "deep_150": (
            f"{_HEAD}<home>{WALLS}{'<furnitureGroup>' * 150}{CHAIRS}{'</furnitureGroup>' * 150}</home>"
        ).encode(),
        "latin1_as_utf8": f"<?xml version='1.0' encoding='UTF-8'?>{latin}".encode("latin-1"),
        "latin1": f"<?xml version='1.0' encoding='ISO-8859-1'?>{latin}".encode("latin-1"),
        "utf16": f"<?xml version='1.0' encoding='UTF-16'?>{latin}".encode("utf-16"),
        "utf16_as_utf8": f"<?xml version='1.0' encoding='UTF-8'?>{latin}".encode("utf-16"),
        "unknown_encoding": f"<?xml version='1.0' encoding='X-NOBODY'?>{body}".encode(),
        "utf7": f"<?xml version='1.0' encoding='UTF-7'?>{body}".encode(),
        "nul": XML.replace(b"Hall", b"Ha\0ll"),
        "other_root": f"{_HEAD}<house>{WALLS}</house>".encode(),
        "html": b"<!DOCTYPE html><html><body>404</body></html>",
        "namespaced": body.replace("<home ", "<home xmlns='urn:x' ").encode(),
        "no_version": b"<home><room/><wall/><pieceOfFurniture/></home>",
        "unknown_elements": text.replace("</home>", "<spaceship a='1'/></home>").encode(),
        "path_in_model": text.replace("model='1'", "model='../../../etc/passwd'").encode(),
        "root_path_in_model": text.replace("model='1'", "model='/etc/passwd'").encode(),
        "url_in_model": text.replace("model='1'", "model='http://127.0.0.1:9/a'").encode(),
    }


def _laughs() -> bytes:
    rows = "".join(f"<!ENTITY a{k} '{f'&a{k - 1};' * 10}'>" for k in range(1, 12))
    return f"{_HEAD}<!DOCTYPE home [<!ENTITY a0 'ha'>{rows}]><home name='&a11;'/>".encode()


def _attributes() -> bytes:
    many = " ".join(f"a{k}='{k}'" for k in range(300_000))
    return XML.replace(b"<home ", f"<home {many} ".encode())


def _comment() -> bytes:
    return XML.replace(b"</home>", b"<!--" + b"x" * 15_000_000 + b"--></home>")
