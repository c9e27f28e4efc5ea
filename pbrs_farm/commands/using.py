"""Verbs that use what was made: sheet, verify, relight. Effects: read and write an output folder."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

from pbrs_farm.commands.arguments import Verb, complain, dump, say
from pbrs_farm.core.errors import BadInput

if TYPE_CHECKING:
    from pbrs_farm.run.relight import LampFactor


def add_verbs(verb: Verb) -> None:
    """Add sheet, verify and relight."""
    p = verb(
        "sheet", _sheet, "contact sheet (sheet.png) and gallery (index.html) of an output folder"
    )
    p.add_argument("folder", type=Path)
    p.add_argument("--views", type=int, default=24, help="rows of the contact sheet (default 24)")
    p = verb(
        "verify",
        _verify,
        "recompute labels from the stored files by another caster: a certificate; --light: prove"
        " the light transport on rooms with known answers",
    )
    p.add_argument("folder", type=Path, nargs="?", default=None, help="the folder of --out")
    p.add_argument(
        "--light",
        action="store_true",
        help="no files: furnace rooms, Metropolis against path, exact facts; under a minute",
    )
    p.add_argument("--all", action="store_true", help="every pixel instead of a sample")
    p.add_argument("--sample", type=int, default=None, metavar="N", help="pixels a view")
    p.add_argument("--json", action="store_true", help="certificate or claims as JSON")
    p = verb(
        "relight",
        _relight,
        "other strengths of lamps and daylight from a stored view, no rendering",
    )
    p.add_argument("view", type=Path, help="a view's folder: OUT/houses/<house>/views/<view>")
    p.add_argument("--indoor", type=float, default=1.0, help="factor of the lamps (default 1)")
    p.add_argument("--outdoor", type=float, default=1.0, help="factor of the sky (default 1)")
    p.add_argument(
        "--lamp",
        action="append",
        default=[],
        metavar="LAMP=F",
        help="factor F, or R,G,B, of a lamp, repeatable: its number, item or name as --list prints"
        " them, * for any; needs a view rendered with --groups lamps",
    )
    p.add_argument("--list", action="store_true", help="print the view's lamps, relight nothing")
    p.add_argument(
        "--out", type=Path, default=None, help="PNG to write (default VIEW_relit.png here)"
    )
    p.add_argument("--no-denoise", action="store_true", help="develop the raw radiance")


def _sheet(args: argparse.Namespace) -> int:
    write_sheets(args.folder, args.views)
    return 0


def write_sheets(folder: Path, max_views: int) -> None:
    """Write sheet.png and index.html into an output folder and say where they are."""
    from pbrs_farm.gallery.contact_sheet import contact_sheet, gallery
    from pbrs_farm.store.folder import FolderStore

    store = FolderStore(folder)
    store.put("sheet.png", contact_sheet(folder, max_views=max_views))
    store.put("index.html", gallery(folder).encode())
    say(f"{folder / 'sheet.png'}\n{folder / 'index.html'}")


def _verify(args: argparse.Namespace) -> int:
    if args.folder is None and not args.light:
        raise BadInput("verify", "", "nothing to verify", hint="give a FOLDER, or --light")
    if args.folder is not None and args.light:
        raise BadInput("verify", str(args.folder), "--light looks at no folder: one at a time")
    return _verify_light(args) if args.light else _verify_folder(args)


def _verify_folder(args: argparse.Namespace) -> int:
    from pbrs_farm.check import verify

    if args.sample is not None and args.sample < 1:
        raise BadInput("--sample", str(args.sample), "expected at least one pixel")
    certificate = verify(args.folder, sample=args.sample, all_pixels=args.all)
    if args.json:
        dump(certificate.model_dump(mode="json"))
    else:
        say(certificate.text())
    return 0 if certificate.is_clean else 1


def _verify_light(args: argparse.Namespace) -> int:
    from dataclasses import asdict

    from pbrs_farm.raycast.variant import choose_variant
    from pbrs_farm.transport.validation.claims import light_claims

    variant, claims = choose_variant(), []
    if not args.json:
        say(f"{'':<5}{'claim':<63}{'measured':<48}expected")
    for claim in light_claims(variant):
        claims.append(claim)
        if not args.json:
            verdict = "ok" if claim.passed else "FAIL"
            say(f"{verdict:<5}{claim.text:<63}{claim.measured:<48}{claim.expected}")
    n_failed = sum(not claim.passed for claim in claims)
    if args.json:
        rows = [asdict(claim) for claim in claims]
        dump({"variant": variant, "claims": rows, "n_failed": n_failed})
    else:
        seconds = sum(claim.seconds for claim in claims)
        failed = f"{n_failed} FAILED" if n_failed else "all hold"
        say(f"{len(claims)} claims in {variant}, {failed}, {seconds:.0f} s")
    return 1 if n_failed else 0


def _relight(args: argparse.Namespace) -> int:
    from pbrs_farm.run.relight import relit, unlit_lamps
    from pbrs_farm.store.folder import FolderStore

    if args.list:
        if args.lamp or args.out is not None:
            raise BadInput(
                "--list", "", "lists the lamps and makes no picture: not with --lamp, --out"
            )
        return _list_lamps(args.view)
    for name, factor in (("--indoor", args.indoor), ("--outdoor", args.outdoor)):
        if not 0 <= factor < math.inf:
            raise BadInput(name, str(factor), "expected a number that is finite and not negative")
    out = args.out or Path(f"{args.view.resolve().name}_relit.png")
    png = relit(
        args.view,
        indoor=args.indoor,
        outdoor=args.outdoor,
        denoise=not args.no_denoise,
        lamps=[_lamp_factor(word) for word in args.lamp],
    )
    FolderStore(out.parent).put(out.name, png)
    if args.lamp:
        for row in unlit_lamps(args.view, [_lamp_factor(word) for word in args.lamp]):
            complain(f"lamp {row['number']} ({row['item']}) brings no light to this view")
    say(str(out))
    return 0


def _list_lamps(view: Path) -> int:
    from pbrs_farm.run.relight import lamps_of_view

    rows = lamps_of_view(view)
    say(f"{'lamp':>4} {'share':>6} {'lm':>7}  {'item':<12} {'room':<8} name")
    for row in rows:
        share = f"{row['share']:.1%}" if row["layer"] else "-"
        place = f"{row['item']:<12} {row['room'] or '-':<8}"
        say(f"{row['number']:>4} {share:>6} {row['lm']:>7.0f}  {place} {row['name']}")
    return 0


def _lamp_factor(word: str) -> LampFactor:
    """NAME=F or NAME=R,G,B; a name may hold "="."""
    from pbrs_farm.run.relight import LampFactor

    name, _, text = word.rpartition("=")
    try:
        factors = [float(part) for part in text.split(",")]
    except ValueError:
        factors = []
    if not name or len(factors) not in (1, 3) or not all(0 <= f < math.inf for f in factors):
        raise BadInput(
            "--lamp",
            word,
            "expected LAMP=F or LAMP=R,G,B, numbers that are finite and not negative",
        )
    r, g, b = factors * (3 // len(factors))
    return LampFactor(name, (r, g, b))
