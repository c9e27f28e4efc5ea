"""Layout of an output root in a remote store: a view's files packed, houses spread over prefixes.

Callers name objects by the keys of core/keys.py; this module alone maps them to objects of the store.
Effects: those of the store it wraps.

    layout.json                                     says that a root is packed; without it every key is an object
    houses/<hh>/<house>/...                         hh: first two hex digits of the sha256 of the house's id
    houses/<hh>/<house>/packs/<group>.<view>.tar    files and markers of a group of steps of a view
    houses/<hh>/<house>/packs/<step>.<view>.tar     the same of one step, done after its group's pack was written

A pack is an uncompressed tar that appears whole: its steps are done, or they are not. Its first
member is an index, followed by the markers and by the files, small ones first.
"""

from __future__ import annotations

import json
import tarfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Final

from pbrs_farm.core import keys
from pbrs_farm.core.errors import ObjectMissing, StoreFailed
from pbrs_farm.store.object_store import LAYOUT, Head, Store, check_key, check_prefix, get_or_none
from pbrs_farm.store.pack import (
    FORMAT,
    GROUP_OF_STEP,
    GROUPS,
    TAR_BLOCK,
    Pack,
    file_or_marker,
    groups_of,
    house_folder,
    key_of_object,
    marker_of,
    object_key,
    pack_bytes,
    pack_from_head,
    pack_key,
    steps_of,
)

_ORDER: Final = tuple(GROUPS)
_HEAD_BYTES: Final = 2**16  # first read: the index, the markers, small files
_WHOLE_BYTES: Final = 2**22  # first read of a task that needs labels and pictures anyway
_RECENT_S: Final = 10.0  # an index read within this time is trusted
_MOST_RECENT: Final = 256


@dataclass(slots=True)
class _Pending:
    """Unwritten results of one view and group of steps."""

    house: str
    view: str
    group: str
    steps: dict[str, dict[str, bytes]] = field(default_factory=dict)

    def find(self, parts: keys.HouseKey) -> bytes | None:
        if (parts.house, parts.view) != (self.house, self.view):
            return None
        members_of_steps = (members.get(file_or_marker(parts)) for members in self.steps.values())
        return next((data for data in members_of_steps if data is not None), None)


@dataclass(slots=True)
class _Task:
    """Cache of one task."""

    n_head: int
    packs: dict[str, Pack | None] = field(default_factory=dict)  # None: no such pack
    absent: set[str] = field(default_factory=set)  # packs missing at the first request
    objects: dict[str, bytes | None] = field(default_factory=dict)  # markers of the house
    pending: _Pending | None = None


class LaidOutStore:
    """A remote store that reads either layout; packs: True to pack new roots."""

    def __init__(self, inner: Store, packs: bool = True) -> None:
        self.inner = inner
        self._packs = packs
        self._known: bool | None = None  # packed or not; None: the root is empty
        self._recent: dict[str, tuple[float, Pack | None]] = {}  # object -> expiry time, its index
        self._task: _Task | None = None

    def __reduce__(self) -> tuple[object, ...]:
        # Caches are not pickled.
        return LaidOutStore, (self.inner, self._packs)

    @property
    def url(self) -> str:
        return self.inner.url

    def around(self, wrap: Callable[[Store], Store]) -> LaidOutStore:
        """The same layout over a wrapped store (wrap: of the inner one), before the first use of this one."""
        return LaidOutStore(wrap(self.inner), self._packs)

    @property
    def is_packed(self) -> bool:
        """True if the root is packed; False for an empty root. StoreFailed for a later layout."""
        return bool(self._layout())

    def _layout(self) -> bool | None:
        """True if the root is packed, None while it is empty (no recipe in it); then cached."""
        if self._known is None:
            # The layout is written before the recipe, so look for the recipe first.
            has_begun = self.inner.head(keys.RECIPE) is not None
            data = get_or_none(self.inner, LAYOUT)
            if data is not None or has_begun:
                self._known = data is not None and _is_packed(data)
        return self._known

    @contextmanager
    def task(self, *, reads_whole: bool) -> Iterator[LaidOutStore]:
        """This store for the duration of one task, with a cache of markers.

        The results of a view's group of steps are written together, at the end of the task at the latest, even if
        the task fails. reads_whole: the first read fetches packs whole, since the task needs their pictures.
        """
        store = LaidOutStore(self.inner, self._packs)
        store._known = self._layout()
        store._task = _Task(_WHOLE_BYTES if reads_whole else _HEAD_BYTES)
        try:
            yield store
        finally:
            try:
                store._flush()
            finally:
                store._task = None

    def put(self, key: str, data: bytes | memoryview) -> None:
        self._refuse_view(key)
        self._forget(key)
        self.inner.put(self._object(key), data)

    def put_if_absent(self, key: str, data: bytes) -> bool:
        self._refuse_view(key)
        if key == keys.RECIPE and self._packs and self.inner.head(key) is None:
            # Write the layout before any other object.
            row = {"format": FORMAT, "layout": "packed"}
            self.inner.put_if_absent(LAYOUT, (json.dumps(row) + "\n").encode())
        self._forget(key)
        return self.inner.put_if_absent(self._object(key), data)

    def put_done(self, key: str, marker: bytes, files: Mapping[str, bytes]) -> None:
        """Put a step's files and its marker; those of a view together, in a pack."""
        parts = self._of_view(key)
        if parts is None:
            for file, data in files.items():
                self.put(file, data)
            self.put_if_absent(key, marker)
            return
        # Hold it for the pack of its group while the task makes the other steps.
        assert parts.view is not None
        group = GROUP_OF_STEP.get(parts.step, parts.step)
        self._flush_unless(parts.house, parts.view, group)
        task = self._task
        pending = (task and task.pending) or _Pending(parts.house, parts.view, group)
        members = {file_or_marker(_house_key(file)): data for file, data in files.items()}
        pending.steps[parts.step] = {marker_of(parts.step): marker, **members}
        if task is not None:
            task.pending = pending
        if task is None or len(GROUPS.get(group, ())) < 2:  # no other step to wait for
            self._flush(pending)

    def replace_marker(self, key: str, marker: bytes) -> None:
        """Replace a step's marker in one write; in a pack, which must be of this step alone, also its files."""
        parts = self._of_view(key)
        if parts is None:
            self.put(key, marker)
            return
        if GROUPS.get(parts.step) != (parts.step,):
            raise StoreFailed(key, "shares its pack with other steps")
        # Pending results may need the files of this step again.
        self._flush()
        place = pack_key(parts.house, parts.view or "", parts.step)
        data = pack_bytes({parts.step: {marker_of(parts.step): marker}})
        self.inner.put(place, data)
        self._wrote(place, data)

    def get(self, key: str) -> bytes:
        parts = self._of_view(key)
        if parts is None:
            return self._get_object(key)
        if (waiting := self._waiting(parts)) is not None:
            return waiting
        # Retry if a pack was written or replaced after its index was read.
        for is_fresh in (False, True) if not parts.step else (True, True):
            member = self._found(parts, is_fresh=is_fresh)
            if member is None and is_fresh:
                break
            if member is not None and (data := self._member(*member)) is not None:
                return data
        raise ObjectMissing(key, f"no such object in {self.url}")

    def get_range(self, key: str, start: int, n_bytes: int) -> bytes:
        parts = self._of_view(key)
        if parts is None:
            return self.inner.get_range(self._object(key), start, n_bytes)
        if (waiting := self._waiting(parts)) is not None:
            return waiting[start : start + n_bytes]
        member = self._found(parts)
        if member is None:
            raise ObjectMissing(key, f"no such object in {self.url}")
        place, pack, name = member
        _step, first, size = pack.rows[name]
        n_bytes = min(n_bytes, size - start)
        return self.inner.get_range(place, first + start, n_bytes) if n_bytes > 0 else b""

    def head(self, key: str) -> Head | None:
        parts = self._of_view(key)
        if parts is None:
            return self.inner.head(self._object(key))
        if (waiting := self._waiting(parts)) is not None:
            return Head(len(waiting), time.time())
        member = self._found(parts, is_fresh=bool(parts.step))
        if member is None:
            return None
        place, pack, name = member
        whole = self.inner.head(place)
        return Head(pack.rows[name][2], whole.modified_s if whole is not None else 0.0)

    def list(self, prefix: str = "") -> Iterator[str]:
        """As Store.list. In a packed root it reads each pack's index, and first writes pending results."""
        check_prefix(prefix)
        self._flush()
        if not self.is_packed:
            return self.inner.list(prefix)
        return self._list(prefix)

    def delete(self, key: str) -> None:
        parts = self._of_view(key)
        if parts is None:
            self._forget(key)
            self.inner.delete(self._object(key))
        elif parts.step:
            self._drop(parts)
        # A file of a view goes with its marker.

    # Object of a key.

    def _object(self, key: str) -> str:
        check_key(key)
        is_of_house = key.partition("/")[0] in keys.FOLDERS
        return object_key(key) if is_of_house and self.is_packed else key

    def _refuse_view(self, key: str) -> None:
        if self._of_view(key) is not None:
            raise StoreFailed(key, "in a packed root, a view's files are stored with their marker")

    def _of_view(self, key: str) -> keys.HouseKey | None:
        """The parts of the key of a view's file or marker in a packed root, else None."""
        check_key(key)
        if key.partition("/")[0] not in keys.FOLDERS or not self.is_packed:
            return None
        parts = keys.parse_house_key(key)
        return parts if parts is not None and parts.view is not None else None

    def _found(
        self, parts: keys.HouseKey, *, is_fresh: bool = False
    ) -> tuple[str, Pack, str] | None:
        """The object that contains a key, its index, and the key's name in it."""
        house, view, name = parts.house, parts.view or "", file_or_marker(parts)
        for group in groups_of(parts):
            # Without its group's pack, no step of the group is done.
            place = pack_key(house, view, group)
            pack = self._pack(place, is_fresh=is_fresh)
            if pack is None or name in pack.rows:
                if pack is not None:
                    return place, pack, name
                continue
            for step in steps_of(parts, group):
                place = pack_key(house, view, step)
                step_pack = self._pack(place, is_fresh=is_fresh)
                if step_pack is not None and name in step_pack.rows:
                    return place, step_pack, name
        return None

    # Reading.

    def _get_object(self, key: str) -> bytes:
        """An object outside views; a task caches the house's markers and its description."""
        place, task = self._object(key), self._task
        parts = keys.parse_house_key(key) if task is not None else None
        if task is None or parts is None or not (parts.step or parts.file == "house.json"):
            return self.inner.get(place)
        if key not in task.objects:
            task.objects[key] = get_or_none(self.inner, place)
        if (data := task.objects[key]) is None:
            raise ObjectMissing(key, f"no such object in {self.url}")
        return data

    def _waiting(self, parts: keys.HouseKey) -> bytes | None:
        """Data that the task has not written yet. A request for a later group's marker writes the earlier group."""
        task = self._task
        if task is None or task.pending is None:
            return None
        is_same_view = (parts.house, parts.view) == (task.pending.house, task.pending.view)
        later = _ORDER[_ORDER.index(task.pending.group) + 1 :]
        if parts.step and (not is_same_view or GROUP_OF_STEP.get(parts.step) in later):
            self._flush()
            return None
        return task.pending.find(parts)

    def _pack(self, place: str, *, is_fresh: bool = False) -> Pack | None:
        task, now = self._task, time.monotonic()
        if task is not None and place in task.packs:
            return task.packs[place]
        if task is not None and _before(place) in task.absent:
            # Pictures need light: without its pack they are missing or stale.
            return None
        until, recent = self._recent.get(place, (0.0, None))
        if not is_fresh and until > now:
            return recent
        pack = self._read(place)
        if task is not None and pack is None:
            task.absent.add(place)
        self._remember(place, pack)
        return pack

    def _read(self, place: str) -> Pack | None:
        # Of the light, only the step that makes it needs more than the marker.
        is_light = place.rpartition("/")[2].startswith("light.")
        n_head = self._task.n_head if self._task is not None and not is_light else _HEAD_BYTES
        try:
            pack = pack_from_head(self.inner.get_range(place, 0, n_head), place)
            pack = pack or pack_from_head(self.inner.get(place), place)
        except ObjectMissing:
            return None
        if pack is None:
            raise StoreFailed(place, "is not a pack of a view", hint="remove it to make it again")
        return pack

    def _remember(self, place: str, pack: Pack | None) -> None:
        task = self._task
        if task is None:
            while len(self._recent) >= _MOST_RECENT:
                self._recent.pop(next(iter(self._recent), ""), None)
            self._recent[place] = (time.monotonic() + _RECENT_S, pack)
            return
        if task.n_head > _HEAD_BYTES:
            # Cache the pictures of one view at a time.
            view = place.partition("/packs/")[2].partition(".")[2]
            task.packs = {k: p for k, p in task.packs.items() if k.endswith(f".{view}")}
        task.packs[place] = pack

    def _member(self, place: str, pack: Pack, name: str) -> bytes | None:
        """A member's bytes; None if another pack has replaced it."""
        if (packed := pack.held(name)) is not None:
            return packed
        _step, start, n_bytes = pack.rows[name]
        try:
            data = self.inner.get_range(place, start - TAR_BLOCK, TAR_BLOCK + n_bytes)
            entry = tarfile.TarInfo.frombuf(data[:TAR_BLOCK], "ascii", "strict")
        except (ObjectMissing, tarfile.HeaderError):
            entry = None
        if entry is None or (entry.name, entry.size) != (name, n_bytes):
            self._lose(place)
            return None
        return data[TAR_BLOCK:]

    def _list(self, prefix: str) -> Iterator[str]:
        top, _, rest = prefix.partition("/")
        house, slash, below = rest.partition("/")
        folders, view = [prefix], ""
        if top in keys.FOLDERS and slash:
            folder = house_folder(house)
            folders = [f"{folder}{below}"]
            if below.startswith(("views/", "done/")):
                folders = [f"{folder}packs/", *([f"{folder}done/"] if below == "done/" else [])]
                view = below.removeprefix("views/").partition("/")[0] if below[0] == "v" else ""
        listed: set[str] = set()
        last = ""
        for folder in folders:
            for stored_key in self.inner.list(folder):
                key = key_of_object(stored_key)
                parts = key.split("/")
                if len(parts) != 4 or parts[2] != "packs" or parts[0] not in keys.FOLDERS:
                    yield key
                    continue
                if parts[1] != last:
                    listed, last = set(), parts[1]
                of = parts[3].partition(".")[2].removesuffix(".tar")
                if view and of != view:
                    continue
                for name in self._names(stored_key, parts[1], of):
                    if name.startswith(prefix) and name not in listed:
                        listed.add(name)
                        yield name

    def _names(self, place: str, house: str, view: str) -> Iterator[str]:
        pack = self._pack(place, is_fresh=True)
        for name, (step, _start, _size) in pack.rows.items() if pack is not None else ():
            is_marker = name == marker_of(step)
            yield (
                keys.marker_key(house, step, view)
                if is_marker
                else keys.view_key(house, view, name)
            )

    # Writing.

    def _flush_unless(self, house: str, view: str, group: str) -> None:
        """Write pending results unless they belong to this group of this view."""
        pending = self._task.pending if self._task is not None else None
        if pending is not None and (pending.house, pending.view, pending.group) != (
            house,
            view,
            group,
        ):
            self._flush()

    def _flush(self, pending: _Pending | None = None) -> None:
        task = self._task
        pending = pending or (task.pending if task is not None else None)
        if pending is None:
            return
        self._write(pending)
        if task is not None:
            task.pending = None

    def _write(self, pending: _Pending) -> None:
        house, view, group = pending.house, pending.view, pending.group
        place = pack_key(house, view, group)
        present = self._task.packs.get(place) if self._task is not None else None
        if self._task is not None:
            self._task.absent.discard(_before(place))
        if present is None:
            data = pack_bytes(pending.steps)
            if self.inner.put_if_absent(place, data):
                self._wrote(place, data)
                return
            present = self._read(place)
            self._remember(place, present)
        # Steps done after the pack was written, or missing in another writer's pack, get their own.
        for step, members in pending.steps.items():
            name = marker_of(step)
            if present is not None and name in present.rows:
                old_data = self._member(place, present, name)
                if old_data is not None and _digest(old_data) == _digest(members[name]):
                    continue
                self._take_out(house, view, step)
            step_key = pack_key(house, view, step)
            data = pack_bytes({step: members})
            self.inner.put(step_key, data)
            self._wrote(step_key, data)

    def _wrote(self, place: str, data: bytes) -> None:
        self._recent.pop(place, None)
        if self._task is not None:
            self._remember(place, pack_from_head(data, place))

    def _drop(self, parts: keys.HouseKey) -> None:
        self._flush()
        self._take_out(parts.house, parts.view or "", parts.step)

    def _take_out(self, house: str, view: str, step: str) -> None:
        """Remove a step from the packs that contain it, by rewriting them; other steps stay."""
        group = GROUP_OF_STEP.get(step, step)
        place = pack_key(house, view, group)
        if step != group:
            self.inner.delete(pack_key(house, view, step))
            self._lose(pack_key(house, view, step))
        data = get_or_none(self.inner, place)
        pack = pack_from_head(data, place) if data is not None else None
        if pack is None or marker_of(step) not in pack.rows:
            return
        rest: dict[str, dict[str, bytes]] = {}
        for name, (of, _start, _size) in pack.rows.items():
            member = pack.held(name)
            if of != step and member is not None:
                rest.setdefault(of, {})[name] = member
        self._lose(place)
        # Keep an empty pack while a step of the group has its own pack: it is found through the
        # group's.
        if rest or any(self._pack(pack_key(house, view, s)) for s in _others(group, step)):
            self.inner.put(place, pack_bytes(rest))
        else:
            self.inner.delete(place)

    def _forget(self, key: str) -> None:
        if self._task is not None:
            self._task.objects.pop(key, None)

    def _lose(self, place: str) -> None:
        self._recent.pop(place, None)
        if self._task is not None:
            self._task.packs.pop(place, None)


def _before(place: str) -> str:
    """For the pack of a view's pictures, the pack of its light; else ""."""
    folder, _, name = place.rpartition("/")
    return f"{folder}/light.{name.removeprefix('pictures.')}" if name[:9] == "pictures." else ""


def _digest(marker: bytes) -> object:
    try:
        return json.loads(marker).get("digest")
    except (ValueError, AttributeError):
        return marker


def _others(group: str, step: str) -> Iterable[str]:
    return (name for name in GROUPS.get(group, ()) if name not in (step, group))


def _house_key(key: str) -> keys.HouseKey:
    parts = keys.parse_house_key(key)
    if parts is None or parts.view is None:
        raise StoreFailed(key, "not a file of a view")
    return parts


def _is_packed(data: bytes) -> bool:
    try:
        row = json.loads(data)
        layout, number = row["layout"], row["format"]
    except (ValueError, KeyError, TypeError):
        raise StoreFailed(LAYOUT, "damaged", hint='{"format": 1, "layout": "packed"}') from None
    if layout not in ("packed", "files") or number != FORMAT:
        raise StoreFailed(LAYOUT, "written by a newer pbrs_farm", hint="install that version")
    return bool(layout == "packed")


@contextmanager
def one_task(store: Store, *, reads_whole: bool) -> Iterator[Store]:
    """The store for one task, whose writes are packed (LaidOutStore.task); reads_whole: fetch whole packs."""
    if not isinstance(store, LaidOutStore):
        yield store
        return
    with store.task(reads_whole=reads_whole) as task_store:
        yield task_store
