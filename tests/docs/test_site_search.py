"""The search of the docs leads to the right page: twenty queries over the pages' text, ranked as the site's search does.

The site's own index needs a build, which no test does. This ranks pages by BM25 with a boost for titles and for
`search: boost` in a page's front matter, as MkDocs' search does. An answer is right among the first two pages.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from functools import cache

import pytest

from tests.docs.fenced import REPO

DOCS = REPO / "docs"
_TITLE = 4.0  # weight of a word in a title over one in the text
_STOP = frozenset(["a", "an", "and", "are", "as", "at", "be", "by", "does", "for", "from", "how", "i", "in", "is", "it", "my", "of", "on", "or", "the", "to", "what"])  # fmt: skip

QUERIES = {
    "uninstall": ("install",), "delete cache": ("install",), "disk space": ("install", "howto/ten_thousand"),
    "point cloud": ("howto/sensors",), "own background": ("howto/sun_and_hour",), "stereo": ("howto/walk",),
    "coco": ("howto/coco",), "my own classes": ("howto/coco", "formats/export"), "fisheye": ("howto/fisheye", "lenses"),
    "resume": ("howto/ten_thousand",), "gpu": ("light_costs",), "night": ("howto/sun_and_hour",), "hugging face": ("data",),
    "relight": ("howto/relight",), "mlt_il_ol stand for": ("commands",), "kinect": ("howto/sensors", "lenses"),
    "bop": ("howto/own_object",), "floor plan": ("houses/plans", "howto/own_home"), "plugin": ("plugins", "api/plugins"),
    "mujoco": ("howto/simulators", "houses/scenes"), "how long does it take": ("howto/ten_thousand", "light_costs"),
    "kubernetes": ("farm", "tutorials/operator"), "licence": ("licences",),
}  # fmt: skip


def words_of(text: str) -> list[str]:
    """The words of a text that count, without their endings."""
    words = re.findall(r"[a-z_]+", text.lower())
    return [re.sub(r"(ing|ed|es|s)$", "", word) for word in words if word not in _STOP]


@cache
def sections() -> tuple[tuple[str, float, frozenset[str], Counter[str]], ...]:
    """(page, boost, words of the title, words of the text with their counts) of each section of each page."""
    found = []
    for path in sorted(DOCS.rglob("*.md")):
        page = str(path.relative_to(DOCS).with_suffix(""))
        text = path.read_text(encoding="utf-8")
        stated = re.search(r"\A---\n.*boost: ([\d.]+)", text, re.DOTALL)
        boost = float(stated[1]) if stated else 0.3 if page.startswith("lab/") else 1.0
        text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
        for part in re.split(r"^#+ (?=\w)", text, flags=re.MULTILINE)[1:]:
            title, _, body = part.partition("\n")
            found.append((page, boost, frozenset(words_of(title)), Counter(words_of(body))))
    return tuple(found)


def ranked(query: str) -> list[str]:
    """The pages for a query, the best first."""
    rows, terms = sections(), words_of(query)
    mean = sum(body.total() for *_, body in rows) / len(rows)
    score: Counter[str] = Counter()
    for page, boost, title, body in rows:
        value = 0.0
        for term in terms:
            n_with = sum(term in words or term in heads for _, _, heads, words in rows)
            rarity = math.log(1 + (len(rows) - n_with + 0.5) / (n_with + 0.5))
            saturated = body[term] * 2.2 / (body[term] + 1.2 * (0.25 + 0.75 * body.total() / mean))
            value += rarity * (saturated + _TITLE * (term in title))
        score[page] = max(score[page], boost * value)
    return [page for page, value in score.most_common() if value > 0]


@pytest.mark.parametrize("query", QUERIES)
def test_the_right_page_is_among_the_first_two(query: str) -> None:
    best = ranked(query)[:2]
    assert {*best} & {*QUERIES[query]}, best
