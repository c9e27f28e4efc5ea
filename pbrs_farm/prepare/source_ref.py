"""A source: the name of a house before it is read, with digests of its files. No effects."""

from __future__ import annotations

from pathlib import Path

from pbrs_farm.core import keys
from pbrs_farm.core.edits import Edit, edited_id, edits_digest
from pbrs_farm.core.record import Record
from pbrs_farm.read.common.format import GivenFile


class SourceRef(Record):
    """A house before it is read.

    kind: of a format (prepare/formats.py), `reader` for a plugin's format, or of HOME_KINDS
    (prepare/home_kinds.py). location: a path, an example home's name, "builtin" or the word of a made home;
    `NAME:path` of a plugin's format; of an object without context the JSON of its ObjectModel. sha256: of
    the file's bytes (SUNCG: of house.json). companions: digest of all other files that reading opens,
    "" = none. dress_seed: of the dressing between reading and repair; the id then ends in `-d<seed>`.
    edits: changes of the repaired house, in order; the id then ends in `-e<digest>`. models: the
    folder of the models that the file names, "" = where its format keeps them. part: of a plan's
    file: `apartment=ID`, `floor=K`; "" = the whole file.
    """

    kind: str
    location: str
    house_id: str
    sha256: str
    companions: str = ""
    dress_seed: int = 0  # 0 = as it was drawn
    edits: tuple[Edit, ...] = ()
    models: str = ""
    part: str = ""

    @property
    def word(self) -> str:
        """The word of a command line that names the source before dressing and edits."""
        return f"{self.location}#{self.part}" if self.part else self.location

    @property
    def given(self) -> GivenFile:
        """The file or folder of a file-based source."""
        path = self.location.partition(":")[2] if self.kind == "reader" else self.location
        return GivenFile(Path(path), self.models, self.part)

    @property
    def fingerprint(self) -> str:
        """Digest of every file the source reads; without companions, the digest of the source file."""
        return "+".join(filter(None, (self.sha256, self.companions, edits_digest(self.edits))))

    @property
    def unedited(self) -> SourceRef:
        """The same house, dressed or not, before its edits."""
        if not self.edits:
            return self
        bare_id = self.house_id.removesuffix(edited_id("", self.edits))
        return self.model_copy(update={"house_id": bare_id, "edits": ()})

    def edited(self, *edits: Edit) -> SourceRef:
        """The same house with these edits appended."""
        all_edits = (*self.edits, *edits)
        house_id = edited_id(self.unedited.house_id, all_edits)
        return self.model_copy(update={"house_id": house_id, "edits": all_edits})


def home_id(source: SourceRef) -> str:
    """The id of the source's undressed house."""
    return source.unedited.house_id.removesuffix(keys.dressed_id("", source.dress_seed))
