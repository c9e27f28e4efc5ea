"""A data set as one file: homes, options of `run`, `select` and `export`, a card. Effect: reads it.

split = "80/10/10"        # by home; without it nothing is split
[card]
title = "Rooms"
[render]                  # options of `run`, for every part
recipe = "fast"
dress = "1"
[part.views]              # homes, and options that hold for them
homes = ["made:1..100"]
views = 10
select = ["black", "twins"]
[form.coco]               # options of `export`, or of `pack` (shards, parquet)
parts = ["views"]
"""

from __future__ import annotations

import argparse
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from pbrs_farm.commands.arguments import dress_seeds, recipe_of
from pbrs_farm.commands.labelling import choice_of, packing_of
from pbrs_farm.commands.options import request_from
from pbrs_farm.core.errors import BadInput, PbrsError
from pbrs_farm.core.house_split import shares_from_text
from pbrs_farm.core.options import option, options_of, values_of_table
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.core.record import Record
from pbrs_farm.core.shown_text import did_you_mean, hint_of_choice
from pbrs_farm.curate.teaching_rules import REASONS
from pbrs_farm.export.chosen_view import Choice
from pbrs_farm.export.form import ViewForm, form_names, form_of, options_from
from pbrs_farm.export.view_options import ViewOptions
from pbrs_farm.prepare.home_kinds import kind_of_word
from pbrs_farm.prepare.source import resolve, words_of_homes
from pbrs_farm.regular_files import read_given, text_from_bytes
from pbrs_farm.run.request import CameraOptions, ModelsOption, Request, wanted_of
from pbrs_farm.run.step_cache import camera_file_text
from pbrs_farm.sample.camera_source import source_of
from pbrs_farm.sets.data_set import SHIPPED, DataSet, SetCard, SetForm, SetPart, shipped_sets
from pbrs_farm.truth.optional_layers import check_lens
from pbrs_farm.views.packing.pack_options import PackOptions
from pbrs_farm.views.packing.packing_plan import FORMS

_ENDING: Final = ".toml"
_TABLES: Final = ("card", "render", "part", "form")
_SHARD_SIZE: Final = 500  # default views per shard of a set
_NAME: Final = re.compile(r"[a-z0-9][a-z0-9_-]{0,40}")


class PartOptions(Request, CameraOptions, ModelsOption):
    """Render options of a part: those of `run`, for its homes."""

    select: tuple[str, ...] = option(
        (), "rules that exclude views from the exports", choices=tuple(REASONS)
    )


class PartTable(PartOptions):
    """A table [part.NAME]."""

    homes: tuple[str, ...] = option((), "homes, as for `run`")


class CardTable(Record):
    """The table [card]."""

    title: str = option("", "title of the set")
    text: str = option("", "purpose, in Markdown")
    licence: str = option("", "licence of the set")


class FormTable(Record):
    """The entries of every table [form.NAME]."""

    to: str = option("", "format (default: the table's name)")
    parts: tuple[str, ...] = option((), "parts to export (default: all)")


class ViewFormTable(FormTable, ViewOptions):
    """A table [form.NAME] of `export`; the options of its form are added to it."""


class PackTable(FormTable, PackOptions):
    """A table [form.NAME] of `pack`."""


def is_set(word: str) -> bool:
    """True if a word names a shipped data set (even if a file has that name) or a .toml file with parts."""
    if word in shipped_sets():
        return True
    if not word.endswith(_ENDING) or not Path(word).is_file():
        return False
    # Other TOML files are jobs or programmes of homes; their readers report invalid TOML.
    try:
        return "part" in tomllib.loads(text_from_bytes(read_given(Path(word))))
    except (ValueError, RecursionError):
        return False


def set_from_word(word: str) -> DataSet:
    """The data set of that name, or of a user's file.

    Checks the whole file: every home and folder exists, every option is valid, and every form can hold
    the views of its parts. Reads no home. Raises BadInput with file and place.
    """
    if word in shipped_sets():
        return set_from_bytes((SHIPPED / f"{word}{_ENDING}").read_bytes(), f"{word}{_ENDING}")
    if not word.endswith(_ENDING):
        hint = hint_of_choice(word, shipped_sets())
        raise BadInput(word, "", "no such set", hint=f"{hint}, or a FILE.toml")
    return set_from_bytes(read_given(Path(word)), word)


def set_from_bytes(data: bytes, file: str) -> DataSet:
    """Parse a data set's file; file is its name, for messages and the set's own name."""
    name = Path(file).stem
    if not _NAME.fullmatch(name):
        raise BadInput(file, "", "the name of a set may have lower-case letters, digits, - and _")
    try:
        # Decode without the byte order mark that some editors write.
        tables = tomllib.loads(text_from_bytes(data))
    except (ValueError, RecursionError) as error:
        raise BadInput(file, "", f"is not valid TOML: {error}") from None
    _check_tables(tables, file)
    with _placed(file, "split"):
        shares = shares_from_text(str(tables["split"])) if "split" in tables else None
    of_card = values_of_table(tables.get("card", {}), CardTable, f"{file} [card]")
    parts = tuple(
        _part(part, table, tables.get("render", {}), file) for part, table in tables["part"].items()
    )
    names = tuple(part.name for part in parts)
    forms = tuple(
        _form(form, table, names, shares, file) for form, table in tables.get("form", {}).items()
    )
    _check_forms(forms, parts, file)
    parts = tuple(_stored(part, forms) for part in parts)
    card = SetCard(
        of_card.get("title") or name, of_card.get("text", ""), of_card.get("licence", "")
    )
    return DataSet(name, data, card, shares, parts, forms)


def _check_tables(tables: Mapping[str, Any], file: str) -> None:
    for name, table in tables.items():
        if name != "split" and (name not in _TABLES or not isinstance(table, dict)):
            hint = did_you_mean(name, [*_TABLES, "split"]) or f"[{'], ['.join(_TABLES)}], split"
            raise BadInput(file, name, "is not a table of a set", hint=hint)
    if not tables.get("part"):
        raise BadInput(file, "part", "names no homes", hint="[part.views] with homes = [...]")
    for kind in ("part", "form"):
        for name, table in tables.get(kind, {}).items():
            if not isinstance(table, dict):
                raise BadInput(file, f"{kind}.{name}", f"expected a table [{kind}.NAME]")
            if not _NAME.fullmatch(name):
                text = "a name may have lower-case letters, digits, - and _"
                raise BadInput(file, f"{kind}.{name}", text)


@contextmanager
def _placed(file: str, place: str) -> Iterator[None]:
    """Add the file and the place in it to errors raised within."""
    try:
        yield
    except PbrsError as error:
        raise BadInput(file, place, error.message, hint=error.hint) from None


def _part(name: str, table: Mapping[str, Any], common: Mapping[str, Any], file: str) -> SetPart:
    """A part: the options of [render], then those of its table; lists of both are joined."""
    values = values_of_table(common, PartOptions, f"{file} [render]")
    for option_name, value in values_of_table(table, PartTable, f"{file} [part.{name}]").items():
        common_value = values.get(option_name)
        values[option_name] = [*common_value, *value] if isinstance(common_value, list) else value
    homes = values.pop("homes", [])
    with _placed(file, f"part.{name}"):
        words = words_of_homes(homes)
        if not words:
            raise BadInput("homes", "", "expected a list of homes", hint='homes = ["made:1..100"]')
        request = request_from(argparse.Namespace(**values), PartOptions)
        recipe = recipe_of(request)
        want = wanted_of(request)
        _check_homes(words, request.models)
        _check_recipe(recipe)
        if want.layers:
            check_lens(want.layers, recipe.lens.lens)
        seeds = dress_seeds(request.dress)
    rules = tuple(rule for rule in REASONS if rule in request.select)
    return SetPart(
        name, tuple(dict.fromkeys(words)), recipe, want, seeds, request.models, rules, values
    )


def _check_homes(words: Sequence[str], models: str) -> None:
    """Raise the error of the first home that cannot be found, and of a folder of models that does not exist."""
    if models and not Path(models).is_dir():
        raise BadInput("models", models, "no such folder")
    for word in words:
        kind = kind_of_word(word)
        if kind is None:
            resolve(word, models=models)


def _check_recipe(recipe: Recipe) -> None:
    """Raise the error of a style, a furniture library or a camera file that does not exist."""
    from pbrs_farm.dress.style import check_style
    from pbrs_farm.prepare.dress_catalogue import GENERATED

    check_style(recipe.dress.style)
    for path in filter(None, recipe.dress.catalogue.split(":")):
        if path != GENERATED and not Path(path).exists():
            raise BadInput("dress.catalogue", path, "no such file or folder")
    if source_of(recipe.cameras).is_file:
        camera_file_text(recipe.cameras)


def _check_forms(forms: Sequence[SetForm], parts: Sequence[SetPart], file: str) -> None:
    """Raise BadInput for a form that cannot hold the views of one of its parts."""
    for form in forms:
        kind = form_of(form.to) if form.packing is None else None
        if not isinstance(kind, ViewForm):
            continue
        for part in parts:
            text = _misfit(kind, part, form.choice) if part.name in form.parts else ""
            if text:
                hint = 'parts = ["..."] names other parts'
                raise BadInput(file, f"form.{form.name}: part {part.name}", text, hint=hint)


def _misfit(form: ViewForm, part: SetPart, choice: Choice) -> str:
    """Reason why a form cannot hold the views of a part; "" if it can."""
    lens, layers = part.recipe.lens.model, set(part.want.layers)
    if form.lenses and lens not in form.lenses:
        return f"lens.model {lens}: this format supports {', '.join(form.lenses)}"
    if form.layers and layers.isdisjoint(form.layers):
        return f"{form.name} needs a layer of {', '.join(form.layers)}"
    if part.want.drop_radiance and _reads_radiance(form, choice):
        return "the form reads radiance.exr: omit drop_radiance"
    if form.is_of_frames and source_of(part.recipe.cameras).is_sequence is False:
        return f'{form.name} needs frames of sequences (cameras = "walk")'
    return ""


def _reads_radiance(form: ViewForm, choice: Choice) -> bool:
    return form.reads_radiance or "radiance" in (choice.layers or ())


def _stored(part: SetPart, forms: Sequence[SetForm]) -> SetPart:
    """The part, without radiance.exr unless its file asks for it, a form reads it, or it holds lamps one by one."""
    kinds = [(form_of(f.to), f.choice) for f in forms if not f.packing and part.name in f.parts]
    is_read = any(isinstance(k, ViewForm) and _reads_radiance(k, choice) for k, choice in kinds)
    if is_read or part.recipe.light.groups == "lamps" or "drop_radiance" in part.values:
        return part
    want = part.want.model_copy(update={"drop_radiance": True})
    return replace(part, want=want, values={**part.values, "drop_radiance": True})


def _form(
    name: str, table: Mapping[str, Any], parts: tuple[str, ...], shares: Any, file: str
) -> SetForm:
    place, to = f"{file} [form.{name}]", str(table.get("to", "")) or name
    with _placed(file, f"form.{name}"):
        forms = (*form_names(), *FORMS)
        if to not in forms:
            raise BadInput("to", to, "no such form", hint=hint_of_choice(to, forms))
    if to in FORMS:
        values = {"shard_size": _SHARD_SIZE} | values_of_table(table, PackTable, place)
        with _placed(file, f"form.{name}"):
            pack_table = request_from(argparse.Namespace(**values), PackTable)
            # Without modes, use those of each part.
            packing = packing_of(pack_table, shares, ())
            return SetForm(name, to, _parts_of(pack_table, parts), packing=packing)
    common = options_of(ViewFormTable)
    of_form = {k: v for k, v in table.items() if k.replace("-", "_") not in common}
    values = values_of_table(
        {k: v for k, v in table.items() if k not in of_form}, ViewFormTable, place
    )
    with _placed(file, f"form.{name}"):
        view_table = request_from(argparse.Namespace(**values), ViewFormTable)
        form = form_of(to)
        if not isinstance(form, ViewForm):
            raise BadInput("to", to, "exports homes, not views")
        if view_table.classes and not form.has_classes:
            raise BadInput("classes", "", f"{to} has fixed classes")
        options = options_from(form, {k.replace("-", "_"): v for k, v in of_form.items()})
        choice = replace(choice_of(view_table), options=options)
        return SetForm(name, to, _parts_of(view_table, parts), choice)


def _parts_of(table: FormTable, parts: tuple[str, ...]) -> tuple[str, ...]:
    for part in table.parts:
        if part not in parts:
            raise BadInput("parts", part, "no such part", hint=hint_of_choice(part, parts))
    return table.parts or parts


def options_given(part: SetPart) -> dict[str, Any]:
    """A part's options for `submit`, viewpoints as recipe fields; BadInput for a user's trajectory file."""
    values = dict(part.values)
    values.pop("select", None)
    if "trajectory" in values:
        raise BadInput("trajectory", str(values["trajectory"]), "cannot be submitted to a farm")
    of_cameras = {
        name: shown.sets
        for name, (_field, shown) in options_of(CameraOptions).items()
        if shown.sets
    }
    pairs = [f"{of_cameras[name]}={values.pop(name)}" for name in of_cameras if name in values]
    if pairs:
        values["set"] = [*values.get("set", []), *pairs]
    return values
