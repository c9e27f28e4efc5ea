"""HTML pages from the jinja2 templates beside the code, every value escaped. Effects: reads them."""

from __future__ import annotations

import functools
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, Template

from pbrs_farm.core.shown_text import printable


def page(package: str, template: str, **values: Any) -> str:
    """The template file of a package filled with values; only markupsafe.Markup is not escaped.

    Raises jinja2.UndefinedError for a name the template uses and values lacks.
    """
    return compile_template(package, template).render(values)


@functools.cache
def compile_template(package: str, template: str) -> Template:
    """The template file of a package, ready to be filled; each is compiled once a process.

    Names in the template that are not given when it is filled are errors, and all text is escaped
    but markupsafe.Markup. `page` fills one in a single call.
    """
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
