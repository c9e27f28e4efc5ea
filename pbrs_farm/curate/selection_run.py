"""`pbrs-farm select`: stored histograms -> scores -> verdicts -> selection/<run>.*. Effects: the store's.

A run's scores are stored in its Parquet file. Houses with unchanged histograms are not scored
again, and new thresholds need no new scores. No picture is opened.
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadInput, ObjectMissing
from pbrs_farm.core.lighting import Mode
from pbrs_farm.core.recipe import HistogramFields, SelectionFields
from pbrs_farm.curate.selection_summary import SelectionSummary, summary_of
from pbrs_farm.formats.histogram_json import ViewRecord, record_from_json
from pbrs_farm.formats.manifest import sha256_by_key
from pbrs_farm.selection.histogram_pack import (
    HistogramPack,
    bytes_from_pack,
    pack_from_bytes,
    pack_house,
    pack_source,
)
from pbrs_farm.selection.reference_set import Reference, check_comparable
from pbrs_farm.selection.scores import SCORES, Scorer, merge_tables
from pbrs_farm.selection.verdicts import verdicts
from pbrs_farm.store.laid_out import LaidOutStore
from pbrs_farm.store.object_store import Store, get_or_none

_METADATA: Final = (
    b"pbrs_farm"  # key in the Parquet file's metadata: reference and mode of its scores
)
Progress = Callable[[int, int], None]  # (houses done, houses in all)


def select(
    store: Store,
    reference: Reference,
    fields: SelectionFields,
    *,
    reference_name: str = "reference",
    run: str = "default",
    progress: Progress | None = None,
) -> SelectionSummary:
    """Score new views, judge every view, write selection/<run>.parquet, .jsonl, selection.json.

    A view whose histogram.json is missing or damaged is marked failed; the others are unaffected.
    Raises BadInput if the settings of the reference differ from those of the views' histograms.
    """
    score_mode = Mode(fields.score_mode)
    houses = _houses(store)
    sources = {h: _source(store, h, views, score_mode) for h, views in houses.items()}
    facts = {"reference": reference.digest, "score_mode": str(score_mode)}
    # Keep valid scores; score the houses without any.
    old = _kept_rows(store, run, facts, sources)
    judged = set(old["house"].unique().to_pylist())
    todo = [h for h in sources if h not in judged and houses[h]]

    def packs() -> Iterator[HistogramPack]:
        for done, house in enumerate(todo):
            pack = _house_pack(store, house, houses[house], sources[house], score_mode)
            if any(pack.modes):
                check_comparable(reference, pack.settings, reference_name)
            yield pack
            if progress is not None:
                progress(done + 1, len(todo))

    scores = merge_tables(old, *Scorer(reference).score_all(packs()))
    return _write_run(store, run, scores, fields, facts, reference, n_scored_houses=len(todo))


def verdict_table(store: Store, run: str = "default") -> Any:
    """The stored table (SCORES, verdicts) of a run, which later views are not in; BadInput without."""
    table = _stored_run(store, run)
    if table is None:
        hint = "`pbrs-farm select` first"
        raise BadInput(keys.selection_key(run, "parquet"), "", "no such run", hint=hint)
    return table


def house_pack(store: Store, house: str, score_mode: Mode) -> HistogramPack:
    """The histograms of one house, from its pack or, if out of date, from its views."""
    views = _houses(store, house)[house]
    return _house_pack(store, house, views, _source(store, house, views, score_mode), score_mode)


def _houses(store: Store, house: str = "") -> dict[str, dict[str, bool]]:
    """House id -> view id -> True if it has a histogram.json, in order, by a manifest if there is one."""
    manifest = keys.house_key(house, keys.MANIFEST) if house else keys.MANIFEST
    rows = get_or_none(store, manifest) if isinstance(store, LaidOutStore) else None
    if rows is not None:
        found_keys: Iterable[str] = sha256_by_key(rows)
    else:
        found_keys = store.list(keys.house_key(house) if house else f"{keys.FOLDERS[0]}/")
    houses: dict[str, dict[str, bool]] = {}
    for key in found_keys:
        p = keys.parse_house_key(key)
        if p is not None and p.view is not None and p.file in ("histogram.json", "view.json"):
            views = houses.setdefault(p.house, {})
            views[p.view] = views.get(p.view, False) or p.file == "histogram.json"
    return {house: dict(sorted(views.items())) for house, views in sorted(houses.items())}


def _source(store: Store, house: str, views: Mapping[str, bool], score_mode: Mode) -> str:
    """Digest of all inputs of the house's scores: from its manifest, else from the files."""
    # The manifest holds the hash of every file: without one, read the files.
    try:
        hashes = sha256_by_key(store.get(keys.house_key(house, keys.MANIFEST)))
    except (ObjectMissing, ValueError, KeyError, TypeError):
        hashes = {}
    digests = {}
    for view, has in views.items():
        key = keys.view_key(house, view, "histogram.json")
        digests[view] = "" if not has else hashes.get(key) or keys.sha256(store.get(key))
    return keys.digest(house, digests, str(score_mode))


def _house_pack(
    store: Store, house: str, views: Mapping[str, bool], source: str, score_mode: Mode
) -> HistogramPack:
    key = keys.histogram_pack_key(house)
    try:
        data = store.get(key)
        if pack_source(data) == source:
            return pack_from_bytes(data, key)
    except (ObjectMissing, BadInput):
        pass  # missing or damaged: made again
    # Pack the records of one setting, the others marked as failed.
    records, failed = _records(store, house, views)
    settings = records[0].settings if records else HistogramFields()
    for record in records:
        if record.settings != settings:
            failed[record.view] = "histogram.json was made with other settings: run again"
    records = [r for r in records if r.view not in failed]
    pack = pack_house(house, source, settings, records, failed=failed, score_mode=score_mode)
    store.put(key, bytes_from_pack(pack))
    return pack


def _records(
    store: Store, house: str, views: Mapping[str, bool]
) -> tuple[list[ViewRecord], dict[str, str]]:
    records, failed = [], {}
    for view, has in views.items():
        key = keys.view_key(house, view, "histogram.json")
        # An unreadable view does not affect the others.
        try:
            if not has:
                raise BadInput(key, "", "missing", hint="render the view again")
            record = record_from_json(store.get(key), key)
            if (record.house, record.view) != (house, view):
                raise BadInput(key, "", f"belongs to view {record.house} {record.view}")
            records.append(record)
        except (BadInput, ObjectMissing) as error:
            failed[view] = str(error)
    return records, failed


def _stored_run(store: Store, run: str) -> Any:
    key = keys.selection_key(run, "parquet")
    try:
        return pq.read_table(io.BytesIO(store.get(key)))
    except ObjectMissing:
        return None
    except (pa.ArrowException, OSError):
        hint = "delete it and select again"
        raise BadInput(key, "", "cannot be read as Parquet", hint=hint) from None


def _facts(table: Any) -> dict[str, str]:
    text = (table.schema.metadata or {}).get(_METADATA, b"{}")
    return dict(json.loads(text))


def _kept_rows(store: Store, run: str, facts: dict[str, str], sources: Mapping[str, str]) -> Any:
    """Valid stored scores: same reference and mode, the house unchanged."""
    table = _stored_run(store, run)
    if table is None or _facts(table) != facts or set(SCORES.names) - set(table.column_names):
        return SCORES.empty_table()
    table = table.select(SCORES.names).cast(SCORES)
    # Keep the rows of houses whose histograms still have the digest stored with the scores.
    houses, rows = table["house"].to_numpy(), table["source"].to_numpy()
    holds = np.fromiter(
        (sources.get(h) == s for h, s in zip(houses, rows, strict=True)), bool, len(houses)
    )
    return table.filter(pa.array(holds))


def _write_run(
    store: Store,
    run: str,
    scores: Any,
    fields: SelectionFields,
    facts: dict[str, str],
    reference: Reference,
    *,
    n_scored_houses: int,
) -> SelectionSummary:
    # Write the table with its verdicts, the same as lines of JSON, and the summary.
    judged = verdicts(scores, fields)
    file = io.BytesIO()
    metadata = {_METADATA: keys.canonical_json(facts).encode()}
    pq.write_table(judged.replace_schema_metadata(metadata), file, compression="zstd")
    store.put(keys.selection_key(run, "parquet"), file.getvalue())
    store.put(keys.selection_key(run, "jsonl"), json_lines(judged))
    summary = summary_of(judged, run, fields, reference)
    store.put(keys.SELECTION, (summary.model_dump_json(indent=1) + "\n").encode())
    return summary.model_copy(update={"n_scored_houses": n_scored_houses})


def json_lines(table: Any) -> bytes:
    """A line of JSON per row of a pyarrow table, in batches; six decimals at most, null if unknown."""
    names = table.column_names
    opened = [("{" if k == 0 else ",") + json.dumps(name) + ":" for k, name in enumerate(names)]
    file = io.BytesIO()  # getvalue does not copy: at the paper's scale this is 300 MB
    for batch in table.to_batches(max_chunksize=16384):
        # Join the columns' texts to one line per row.
        pieces: list[Any] = []
        for head, name in zip(opened, names, strict=True):
            pieces += [head, _json_values(batch.column(name))]
        lines = pc.binary_join_element_wise(*pieces, "}\n", "")
        file.write("".join(lines.to_pylist()).encode())
    return file.getvalue()


def _json_values(column: Any) -> Any:
    """The column's values as JSON text."""
    if pa.types.is_string(column.type):
        # Quote each distinct text once: a column has few.
        encoded = column.dictionary_encode()
        texts = pa.array([json.dumps(t) for t in encoded.dictionary.to_pylist()], pa.string())
        values = texts.take(encoded.indices)
    elif pa.types.is_floating(column.type):
        values = pc.round(column, ndigits=6).cast(pa.string())
    else:
        values = column.cast(pa.string())
    return pc.fill_null(values, "null")
