"""HTML pages from the jinja2 templates beside the code, every value escaped. Effects: reads them."""

from __future__ import annotations

import functools
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, Template

from pbrs_farm.core.shown_text import printable


def page(package: str, template: str, **values: Any) -> str:
    """The template file of a package filled with escaped values (but Markup); jinja2.UndefinedError."""
    return compile_template(package, template).render(values)


@functools.cache
def compile_template(package: str, template: str) -> Template:
    """The template file of a package, compiled once; missing names are errors, text is escaped."""
    environment = Environment(
        loader=PackageLoader(package, ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_finalized,
    )
    return environment.get_template(template)


def _finalized(value: Any) -> Any:
    """A string without control characters and direction overrides."""
    return printable(value) if type(value) is str else value
