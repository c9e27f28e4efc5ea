"""Verbs that use an output folder: sheet, verify, relight, pull. Effects: read and write the folder."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from pbrs_farm.commands.arguments import (
    Verb,
    at_least,
    echo,
    echo_json,
    folder_of,
    put_files,
    store_of,
    warn,
)
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.shown_text import shown

if TYPE_CHECKING:
    from pbrs_farm.gallery.sheet_parts import SheetParts
    from pbrs_farm.run.relight import LampFactor
    from pbrs_farm.transport.validation.claims import LightClaim


_UNFINISHED: Final = 3
"""Exit code of `verify` for a folder that a run still fills, if nothing else is wrong."""


def add_verbs(verb: Verb) -> None:
    """Add sheet, verify, relight and pull."""
    for name, handler in (
        ("sheet", _sheet),
        ("verify", _verify),
        ("relight", _relight),
        ("pull", _pull),
    ):
        verb(name, handler)


def _pull(args: argparse.Namespace) -> None:
    from pbrs_farm.progress import counting_bar
    from pbrs_farm.run.output_root import pull

    store = store_of(args.root)
    with counting_bar("files") as tell:
        n_copied, n_there = pull(store, args.out, tell)
    echo(f"{args.out}: {n_copied} files copied, {n_there} already present")


def _sheet(args: argparse.Namespace) -> None:
    write_sheets(args.folder, args.views)
    if args.video:
        _write_films(args.folder)


def _write_films(folder: Path) -> None:
    """Write the films of every sequence in an output folder and print their paths."""
    from pbrs_farm.formats.output_folder import views_of
    from pbrs_farm.gallery.walk_video import films_of, sequences_of

    sequences = sequences_of(views_of(folder))
    if not sequences:
        hint = "pbrs-farm run HOME --cameras walk"
        raise BadInput(folder, "", "no sequence: no view is a frame", hint=hint)
    for house, frames in sequences.items():
        for kind, data in films_of(frames).items():
            name = f"{house}.mp4" if kind == "picture" else f"{house}_{kind}.mp4"
            put_files(folder, {name: data})
            echo(str(folder / name))


def write_sheets(folder: Path, max_views: int, parts: SheetParts | None = None) -> None:
    """Write sheet.png and index.html (parts: made during rendering) and print their paths."""
    from pbrs_farm.gallery.contact_sheet import contact_sheet
    from pbrs_farm.gallery.gallery_page import gallery_pages

    tiles, cards = (parts.tiles(), parts.cards()) if parts else (None, None)
    put_files(folder, {"sheet.png": contact_sheet(folder, max_views=max_views, made=tiles)})
    pages = {name: html.encode() for name, html in gallery_pages(folder, cards)}
    put_files(folder, pages)
    # Remove the pages of an earlier, larger gallery.
    for stale in folder.glob("index-*.html"):
        if stale.name not in pages and stale.stem.removeprefix("index-").isdigit():
            stale.unlink()
    more = f" ({len(pages)} pages)" if len(pages) > 1 else ""
    echo(f"{folder / 'sheet.png'}\n{folder / 'index.html'}{more}")


def _verify(args: argparse.Namespace) -> int:
    if args.folder is None and not args.light:
        raise BadInput("verify", "", "nothing to verify", hint="give a FOLDER, or --light")
    return _verify_light(args) if args.folder is None else _verify_folder(args)


def _verify_folder(args: argparse.Namespace) -> int:
    from pbrs_farm.check import verify
    from pbrs_farm.progress import counting_bar
    from pbrs_farm.run.light_again import LightAgain

    if args.sample is not None:
        at_least("--sample", args.sample, 1)
    with folder_of(args.folder) as folder, counting_bar("views") as tell:
        tracer = LightAgain if args.light else None
        certificate = verify(
            folder, sample=args.sample, all_pixels=args.all, tracer=tracer, tell=tell
        )
    if args.json:
        echo_json(certificate.model_dump(mode="json"))
    else:
        echo(certificate.text())
    unfinished = _UNFINISHED if certificate.verdict == "NOT FINISHED" else 1
    return 0 if certificate.is_clean else unfinished


def _verify_light(args: argparse.Namespace) -> int:
    from dataclasses import asdict

    from pbrs_farm.raycast.variant import choose_variant
    from pbrs_farm.transport.validation.claims import light_claims

    variant, claims = choose_variant(), []
    # Print each result without waiting for the others.
    if not args.json:
        echo(f"{'':<5}{'claim':<63}{'measured':<48}expected")
    for claim in light_claims(variant):
        claims.append(claim)
        if not args.json:
            echo(_claim_row(claim))
    n_failed = sum(not claim.passed for claim in claims)
    if args.json:
        rows = [asdict(claim) for claim in claims]
        echo_json({"variant": variant, "claims": rows, "n_failed": n_failed})
    else:
        echo(_claims_line(variant, claims, n_failed))
    # The verb fails if a claim fails.
    return 1 if n_failed else 0


def _claims_line(variant: str, claims: Sequence[LightClaim], n_failed: int) -> str:
    seconds = sum(claim.seconds for claim in claims)
    failed = f"{n_failed} FAILED" if n_failed else "all hold"
    return f"{len(claims)} claims in {variant}, {failed}, {seconds:.0f} s"


def _claim_row(claim: LightClaim) -> str:
    verdict = "ok" if claim.passed else "FAIL"
    return f"{verdict:<5}{claim.text:<63}{claim.measured:<48}{claim.expected}"


def _relight(args: argparse.Namespace) -> int:
    from pbrs_farm.run.relight import folder_of_view
    from pbrs_farm.settings import settings_from_environment

    store = settings_from_environment().store
    with folder_of_view(args.view, store, needs_light=not args.list) as view:
        return _list_lamps(args, view) if args.list else _relight_view(args, view)


def _relight_view(args: argparse.Namespace, view: Path) -> int:
    from pbrs_farm.run.relight import relit, unlit_lamps

    # Factors scale radiance, so they cannot be negative.
    expected = "expected F or R,G,B, finite numbers of 0 or more"
    indoor = _factors("--indoor", args.indoor, expected, args.indoor)
    outdoor = _factors("--outdoor", args.outdoor, expected, args.outdoor)
    out = args.out or Path(f"{view.resolve().name}_relit.png")
    lamps = [_lamp_factor(argument) for argument in args.lamp]
    denoise = not args.no_denoise
    png = relit(view, indoor=indoor, outdoor=outdoor, denoise=denoise, lamps=lamps)
    put_files(out.parent, {out.name: png})
    # A factor has no effect on lamps that do not light the view.
    for row in unlit_lamps(view, lamps) if lamps else ():
        warn(f"lamp {row['number']} ({row['item']}) does not light this view")
    echo(str(out))
    return 0


def _list_lamps(args: argparse.Namespace, view: Path) -> int:
    from pbrs_farm.run.relight import lamps_of_view

    if args.lamp or args.out is not None:
        problem = "makes no picture: omit --lamp and --out"
        raise BadInput("--list", "", problem)
    rows = lamps_of_view(view)
    echo(f"{'lamp':>4} {'share':>6} {'lm':>7}  {'item':<12} {'room':<8} name")
    for row in rows:
        # A lamp that does not light the view has no layer.
        share = f"{row['share']:.1%}" if row["layer"] else "-"
        place = f"{row['item']:<12} {row['room'] or '-':<8}"
        echo(f"{row['number']:>4} {share:>6} {row['lm']:>7.0f}  {place} {shown(row['name'])}")
    return 0


def _lamp_factor(argument: str) -> LampFactor:
    """Parse NAME=F or NAME=R,G,B; a name may contain "="."""
    from pbrs_farm.run.relight import LampFactor

    name, _, text = argument.rpartition("=")
    expected = "expected LAMP=F or LAMP=R,G,B, finite numbers of 0 or more"
    return LampFactor(name, _factors("--lamp", text if name else "", expected, argument))


def _factors(option: str, text: str, expected: str, argument: str) -> tuple[float, float, float]:
    """F or R,G,B as the factors of three channels; BadInput naming the option and its argument."""
    try:
        factors = [float(part) for part in text.split(",")]
    except ValueError:
        factors = []
    if len(factors) not in (1, 3) or not all(0 <= f < math.inf for f in factors):
        raise BadInput(option, argument, expected)
    # One number is the factor of all three channels.
    r, g, b = factors * (3 // len(factors))
    return r, g, b
