"""Which rule decided the class of each item of a house, by its tag "class:name", if any; no effects."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any, Final

from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.record import Record
from pbrs_farm.core.shown_text import shown
from pbrs_farm.read.common.furniture_classes import CLASS_TAG

# Most reliable first.
_RULES: Final = ("source", "catalogue", "element", "name", "group", "id", "inner-word")
_STRUCTURE: Final = frozenset({"wall", "floor", "ceiling", "ground"})  # classified by the source


class ClassDecision(Record):
    """The class that one rule assigned to all items of one name."""

    rule: str  # one of _RULES, or size or none
    name: str  # name of the NYU40 class
    item: str
    source_class: str
    n_items: int


def class_decisions(items: Iterable[Mapping[str, Any]]) -> tuple[ClassDecision, ...]:
    """The decisions behind the classes of house.json's items but walls and floors, worst first."""
    counts = Counter(
        (_rule(i), int(i.get("nyu40", 0)), str(i.get("name", "")), str(i.get("source_class", "")))
        for i in items
        if i.get("kind") not in _STRUCTURE
    )
    order = {rule: -k for k, rule in enumerate(_RULES)}
    ranked = sorted(counts.items(), key=lambda row: (order.get(row[0][0], -len(_RULES)), row[0]))
    return tuple(
        ClassDecision(
            rule=rule,
            name=NYU40_NAMES[nyu40] if 0 <= nyu40 < len(NYU40_NAMES) else "none",
            item=item,
            source_class=source_class,
            n_items=n,
        )
        for (rule, nyu40, item, source_class), n in ranked
    )


def decisions_text(decisions: tuple[ClassDecision, ...]) -> str:
    """The decisions, and their number per rule, as a Markdown table; otherprop is counted last."""
    by_rule = Counter[str]()
    for d in decisions:
        by_rule[d.rule] += d.n_items
    lines = ["| rule | class | items | name | source |", "|---|---|---|---|---|"]
    lines += [
        f"| {d.rule} | {d.name} | {d.n_items} | {_decision_cell(d.item)} | {_decision_cell(d.source_class)} |"
        for d in decisions
    ]
    n_items = sum(by_rule.values())
    # Otherprop is the class of items that match no other class.
    n_prop = sum(d.n_items for d in decisions if d.name == "otherprop")
    rules = ", ".join(f"{n} by {rule}" for rule, n in by_rule.most_common())
    return "\n".join([*lines, "", f"{n_items} items: {rules}; {n_prop} of class otherprop"])


def _decision_cell(text: str) -> str:
    # A | would end the cell.
    return shown(text, 60).replace("|", " ")


def _rule(item: Mapping[str, Any]) -> str:
    tags = [str(t) for t in item.get("tags", ())]
    tag = next((t.removeprefix(CLASS_TAG) for t in tags if t.startswith(CLASS_TAG)), None)
    return tag or ("none" if "unmapped" in tags else "source")
