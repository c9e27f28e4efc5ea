"""The `pbrs-farm` command: parses arguments, runs one verb's handler, returns an exit code. Effects: the verb's.

A command imports only the module of its verb. Exit codes: 0 success; 1 a part failed, the rest
completed; 2 invalid arguments; 130 interrupted.
"""

from __future__ import annotations

import argparse
import os
import sys
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib import import_module
from importlib.util import find_spec
from typing import Final

import pbrs_farm
from pbrs_farm.commands.arguments import Handler, echo, warn
from pbrs_farm.commands.command_line import VERBS, Parser, add_arguments, unknown_words, verb_first
from pbrs_farm.core.errors import PbrsError
from pbrs_farm.core.shown_text import did_you_mean
from pbrs_farm.crash_notes import waiting_lines
from pbrs_farm.installation import EXTRA_OF, install_command
from pbrs_farm.operating_system import open_standard_streams

# Module of pbrs_farm.commands -> its verbs, in the order of the help.
MODULES: Final = {
    module: tuple(row.verb for row in VERBS.values() if row.module == module)
    for module in dict.fromkeys(row.module for row in VERBS.values())
}
_OF_THE_FARM: Final = ("submitting", "steering")  # modules that need celery and redis
# Modules whose verbs read untrusted files, so they run in a child process that may crash.
OF_STRANGERS: Final = (
    "making",
    "data_sets",
    "scattering",
    "explaining",
    "using",
    "labelling",
    "selecting",
    "submitting",
)


def command() -> int:
    """Run the command given by sys.argv, in a child process if it reads untrusted files; returns the exit code.

    If a library crashes on such a file, only the child ends, and the parent prints an error line.
    """
    open_standard_streams()
    words = _verb_first(sys.argv[1:])
    if _module_of(words) not in OF_STRANGERS:
        return main(words)
    from pbrs_farm.run.processes.verb_process import run_watched

    return run_watched("pbrs_farm.cli:main", words, warn)


def _module_of(words: Sequence[str]) -> str | None:
    return VERBS[words[0]].module if words and words[0] in VERBS else None


def _verb_first(words: Sequence[str]) -> list[str]:
    def parser_of(verb: str) -> argparse.ArgumentParser:
        # If a verb's packages are not installed, it has no options.
        return build_parser(_module_of([verb]), words).verbs().get(verb, Parser())

    return verb_first(words, list(VERBS), parser_of)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command in this process; returns the exit code. argv: sys.argv[1:] if None.

    Tests call it as main(["run", "builtin", "--out", "out/x"]). Prints. Raises only internal errors,
    and SystemExit for invalid arguments.
    """
    if argv is None:
        return command()
    words = _verb_first(argv)
    verb, module = words[0] if words else "", _module_of(words)
    if module in _OF_THE_FARM and not has_farm():
        warn(f"{verb} needs celery and redis: {install_command('workers')}")
        return 1
    if verb and module is None and not verb.startswith("-"):
        offer = did_you_mean(verb, list(VERBS))
        warn(f"no command {verb!r}{f', {offer}' if offer else ''} (pbrs-farm --help lists them)")
        return 2
    try:
        if verb == "demo":
            _start_early(words)
        return _run_parsed(words, verb, module)
    except KeyboardInterrupt:
        warn("interrupted; run the same command again to resume")
        return 130  # 128 + SIGINT, the convention of shells
    finally:
        if verb == "demo":
            _end_untaken()


def _run_parsed(words: Sequence[str], verb: str, module: str | None) -> int:
    """Read the options of a verb and run it."""
    parser = build_parser(module, words) if module else first_screen()
    args, unknown = parser.parse_known_args(words)
    if unknown:
        of_verb = parser.verbs().get(verb, parser)
        of_verb.error(unknown_words(unknown, of_verb))
    args.words = words
    if not hasattr(args, "handler"):
        parser.print_help()
        return 2
    if module not in OF_STRANGERS:
        return _handled(args)
    # Commands of other modules are short, or run until they are stopped.
    with waiting_lines(verb):
        return _handled(args)


def _start_early(words: Sequence[str]) -> None:
    """Start the process that makes the demo's house before the verb's modules are imported."""
    from pbrs_farm.operating_system import OPEN_FILES_MOVE
    from pbrs_farm.run.processes.early_start import FINISHING_HANDLER, start_early
    from pbrs_farm.run.processes.limits import is_room_for_two

    options = {word.partition("=")[0] for word in words}
    # With --jobs the run starts other processes. It renames the log of the process it adopts.
    if OPEN_FILES_MOVE and is_room_for_two() and not options & {"-h", "--help", "--jobs"}:
        # A failed start fails again in the run, which reports it.
        with suppress(OSError):
            start_early(FINISHING_HANDLER)


def _end_untaken() -> None:
    """End the process of _start_early if no run adopted it, for example after invalid arguments."""
    from pbrs_farm.run.processes.early_start import end_untaken

    end_untaken()


def _handled(args: argparse.Namespace) -> int:
    """Run the verb's handler; its exceptions become exit codes."""
    try:
        return int(args.handler(args) or 0)
    except PbrsError as error:
        if args.debug:
            traceback.print_exc()
        warn(str(error))
        return 1
    except ModuleNotFoundError as error:
        # A missing package of an optional extra is not an internal error.
        if error.name not in EXTRA_OF or args.debug:
            raise
        warn(f"this needs {error.name}: {install_command(EXTRA_OF[error.name])}")
        return 1
    except BrokenPipeError:
        # The pipe's reader has closed it: redirect stdout so that Python prints no error at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1


def build_parser(module: str | None = None, words: Sequence[str] | None = None) -> Parser:
    """Build the parser with the verbs of one module of pbrs_farm.commands, or of all modules.

    module: a key of MODULES; a single one makes a command start fast. Verbs of the farm are omitted if
    celery or redis is not installed. words: the command's arguments, on which some options depend;
    None adds all options.
    """
    # All verbs accept --debug, before or after their other options.
    common = Parser(add_help=False)
    common.add_argument("--debug", action="store_true", help="show the traceback of an error")
    parser, add_parser = _bare_parser()

    def verb(name: str, handler: Handler) -> Parser:
        row = VERBS[name]
        sub: Parser = add_parser(name, help=row.help, description=row.help, parents=[common])
        sub.examples = tuple(row.examples.split("; "))
        sub.set_defaults(handler=handler)
        add_arguments(sub, name)
        return sub

    for name in [module] if module else MODULES:
        if name not in _OF_THE_FARM or has_farm():
            import_module(f"pbrs_farm.commands.{name}").add_verbs(verb)
    for name, sub in parser.verbs().items():
        if sub.options_by_words is not None and (words is None or name in words):
            sub.options_by_words(sub, words)
    return parser


def first_screen() -> Parser:
    """Parser for a command without a verb: has all verb names and help texts, and imports no verb."""
    parser, add_parser = _bare_parser()
    for row in VERBS.values():
        if row.module not in _OF_THE_FARM or has_farm():
            add_parser(row.verb, help=row.help, add_help=False)
    return parser


def _bare_parser() -> tuple[Parser, Callable[..., Parser]]:
    """The parser without verbs, and the function that adds a verb."""
    parser = Parser(
        prog="pbrs-farm",
        description="Renders homes designed by people into physically-based training images with exact labels.",
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and exit")
    parser.set_defaults(debug=False, every_verb=build_parser)
    # Without the farm's packages, the help names the command that installs them.
    if not has_farm():
        farm = "submit, status, workers and the other commands of a farm need celery and redis"
        parser.epilog = f"{farm}: {install_command('workers')}"
    return parser, parser.add_subparsers(title="commands", metavar="COMMAND").add_parser


class _Version(argparse.Action):
    """Option that prints the version; the metadata is read only when it is used."""

    def __call__(self, parser: argparse.ArgumentParser, *_parsed: object) -> None:
        echo(pbrs_farm.__version__)
        parser.exit()


def has_farm() -> bool:
    return all(find_spec(package) is not None for package in ("celery", "redis"))


if __name__ == "__main__":
    sys.exit(main())
