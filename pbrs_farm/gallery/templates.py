"""HTML pages from the jinja2 templates beside the code, every value escaped. Effects: reads them."""

from __future__ import annotations

from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined


def page(package: str, template: str, **values: Any) -> str:
    """The template file of a package filled with values; only markupsafe.Markup is not escaped.

    Raises jinja2.UndefinedError for a name the template uses and values lacks.
    """
    environment = Environment(
        loader=PackageLoader(package, ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(template).render(values)
