"""Digests of what a run stores, to compare two commits byte by byte.

Renders the builtin home, three example homes, eight generated homes and one home of each input format
with all labels and pictures at 64x48, and writes the SHA-256 of each stored file to out/bench/bytes.json.
`--homes FOLDER` keeps the files of the input formats there: writers of IFC and Sweet Home 3D put random ids and dates
into them, so two commits compare only if they read the same files. `--against OTHER.json` lists the files that differ
from an earlier report.

Effects: renders into a temporary folder; writes out/bench/bytes.json.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from benchmarks.figures import FOLDER, write_report
from tests.inputs.sound_files import every_format

EXAMPLES = ("Studio", "2BedroomApartment", "3BedroomHouseWithAttic")
N_GENERATED = 8
VIEWS = "2"
SETTINGS = ("--size", "64x48", "--recipe", "preview", "--views", VIEWS, "--jobs", "2")
LAYERS = ("--layers", "albedo", "material", "nocs")
# Files that contain times, machines or versions.
VOLATILE = ("/done/", "manifest.jsonl", "recipe.json")
UNITS = {
    "bytes.files": "stored files that were compared",
    "bytes.failed": "homes that could not be rendered",
}


def main(words: list[str] | None = None) -> None:
    """Render all homes and write the report, or compare two reports."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--against", type=Path, help="an earlier bytes.json: list differing files, exit 1 if any"
    )
    parser.add_argument("--homes", type=Path, help="folder for the files of the input formats")
    options = parser.parse_args([] if words is None else words)
    if options.against:
        raise SystemExit(_compare(options.against, FOLDER / "bytes.json"))
    digests: dict[str, str] = {}
    failed = []
    with tempfile.TemporaryDirectory() as scratch:
        for name, arguments in _jobs(options.homes or Path(scratch) / "homes"):
            out = Path(scratch) / "out" / name
            command = [
                sys.executable,
                "-m",
                "pbrs_farm.cli",
                "run",
                *arguments,
                "--out",
                str(out),
                *SETTINGS,
                *LAYERS,
            ]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode:
                failed.append(name)
                print(f"{name}: {done.stderr.strip()[-300:]}", file=sys.stderr)
            digests |= {f"{name}/{key}": digest for key, digest in _digests(out)}
            print(name, len(digests), flush=True)
    write_report("bytes", {"bytes.files": len(digests), "bytes.failed": len(failed)}, UNITS)
    path = FOLDER / "bytes.json"
    path.write_text(
        json.dumps(json.loads(path.read_text()) | {"digests": digests}, indent=1) + "\n"
    )


def _jobs(homes: Path) -> Iterator[tuple[str, list[str]]]:
    """Name and arguments of each run."""
    yield "builtin", ["builtin"]
    for home in EXAMPLES:
        yield home, [home]
    yield "dressed", ["Studio", "--dress", "3"]
    yield "made", [f"made:1..{N_GENERATED}"]
    yield "made_dressed", ["made:1..2", "--dress", "1"]
    for title, write in sorted(every_format().items()):
        name = "".join(c if c.isalnum() else "_" for c in title)
        folder = homes / name
        note = folder / "home.path"
        if not note.is_file():
            folder.mkdir(parents=True, exist_ok=True)
            note.write_text(str(write(folder)))
        yield name, [note.read_text()]


def _digests(out: Path) -> Iterator[tuple[str, str]]:
    """Path below out and digest of each file whose bytes depend on the home alone."""
    for path in sorted(p for p in out.rglob("*") if p.is_file()):
        key = re.sub(r"-[0-9a-f]{8}(?=[/,])", "", path.relative_to(out).as_posix())
        if key.startswith(".") or any(word in key for word in VOLATILE):
            continue
        data = path.read_bytes()
        if path.suffix == ".json":
            data = json.dumps(_without_versions(json.loads(data)), sort_keys=True).encode()
        yield key, hashlib.sha256(data).hexdigest()


def _without_versions(value: Any) -> Any:
    """The JSON value without versions, digests, times and temporary paths."""
    dropped = (
        "version",
        "versions",
        "digest",
        "digests",
        "seconds",
        "made",
        "software",
        "machine",
        "path",
        "source",
    )
    if isinstance(value, dict):
        return {
            k: _without_versions(v)
            for k, v in value.items()
            if k not in dropped and not k.endswith("_s")
        }
    if isinstance(value, list):
        return [_without_versions(v) for v in value]
    return value


def _compare(before: Path, after: Path) -> int:
    old, new = (json.loads(path.read_text())["digests"] for path in (before, after))
    differing = sorted(key for key in {*old, *new} if old.get(key) != new.get(key))
    print(*differing[:60], sep="\n")
    print(f"{len(differing)} of {len({*old, *new})} files differ")
    return int(bool(differing))


if __name__ == "__main__":
    main(sys.argv[1:])
