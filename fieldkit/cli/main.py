"""The `fieldkit` command: finds the subcommand's file and runs it.

This module and the files of the commands import nothing heavy, so that help is instant: the library is imported when
a command runs. Even Typer is imported only for a subcommand, and its own groups are not used: they import pydantic to
parse their options.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from importlib import import_module

from fieldkit import __version__
from fieldkit.cli.boundary import Boundary
from fieldkit.errors import EXIT_OK, UsageError

# name: one line for `fieldkit --help`. The command is the function `command` in fieldkit/cli/<name>.py; a name may be
# of two words, and its file is then <first>_<second>.py.
COMMANDS = {
    "reference": "Build the reference cloud of a plot from a dense capture.",
    "plan": "Find the camera poses that reconstruct a plot best.",
    "export-mission": "Write a plan as missions for a vehicle, over one plot or many.",
    "check-mission": "Say what photographs a mission file would really give.",
    "upload": "Bring a mission onto a vehicle and make sure that it is there.",
    "replay": "Stand in for a vehicle, by the recording of a real one.",
    "geotag": "Match photographs to a flight log and write their poses.",
    "evaluate": "Score new captures of one or many plots against a reference.",
    "scene new": "Write a new scene file: plants, soil and light of a simulated plot.",
    "scene show": "List the scenes that come with fieldkit, or draw one.",
    "scene from-reference": "Make a scene of a reference's clouds, to plan on.",
    "simulate": "Photograph a simulated plot as a drone would.",
    "demo": "Try fieldkit on a small rendered plot, in two to three minutes.",
    "benchmark": "Measure speed and accuracy against the alternatives.",
    "doctor": "Check this machine: packages, renderer, GPU, memory, cache.",
    "cache": "Show, prune or clear what earlier runs keep for later ones.",
}

_INTRODUCTION = """\
Usage: fieldkit COMMAND [OPTIONS] ...

  Reference clouds and capture scores of field plots from photographs.

Commands:
"""
_CLOSING = """
Options:
  --version  Show the version and exit.
  --help     Show this message and exit.

Every command takes --json (one JSON object on stdout, nothing else there) and
--debug (tracebacks). Exit codes: 0 done, 1 a bug in fieldkit, 2 wrong usage,
3 bad input, 4 reconstruction failed, 5 mission unsafe or not for this vehicle,
6 vehicle link failed, 130 interrupted.

'fieldkit COMMAND --help' explains a command.
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command line and give its exit code."""
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    with Boundary(arguments) as boundary:
        boundary.exit_code = _dispatch(arguments, boundary)
    return boundary.exit_code


def overview() -> str:
    """What `fieldkit --help` prints."""
    return _INTRODUCTION + _list(COMMANDS) + _CLOSING


def module_name(command: str) -> str:
    """The module in fieldkit.cli that holds a command."""
    return command.replace("-", "_").replace(" ", "_")


def _list(names: Iterable[str]) -> str:
    width = max(map(len, COMMANDS))
    return "".join(f"  {name:{width}}  {COMMANDS[name]}\n" for name in names)


def _dispatch(arguments: list[str], boundary: Boundary) -> int:
    match arguments:
        case [] | ["-h" | "--help" | "help"]:
            sys.stdout.write(overview())
            return EXIT_OK
        case ["help", *name]:
            return _run([*name, "--help"], boundary)
        case ["--version" | "-V", *_]:
            sys.stdout.write(f"fieldkit {__version__}\n")
            return EXIT_OK
        case _:
            return _run(arguments, boundary)


def _run(words: list[str], boundary: Boundary) -> int:
    name, arguments = words[0], words[1:]
    if arguments and f"{name} {arguments[0]}" in COMMANDS:
        name, arguments = f"{name} {arguments[0]}", arguments[1:]
    elif name not in COMMANDS:
        group = [known for known in COMMANDS if known.startswith(f"{name} ")]
        if group and arguments in ([], ["--help"], ["-h"]):
            sys.stdout.write(_list(group) + f"\n'fieldkit {group[0]} --help' explains the first, and so on.\n")
            return EXIT_OK
        asked = " ".join([name, *arguments[:1]]) if group else name
        raise UsageError(f"no such command: {asked}", remedy=_suggestion(asked))
    from fieldkit.threads import set_thread_environment

    set_thread_environment()  # before anything imports NumPy
    boundary.command = name
    module = import_module(f"fieldkit.cli.{module_name(name)}")
    boundary.resumable = "resume" in module.command.__annotations__

    import typer

    app = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
    app.command(context_settings={"help_option_names": ["--help", "-h"]})(module.command)
    result = app(args=arguments, prog_name=f"fieldkit {name}", standalone_mode=False)
    return result if isinstance(result, int) else EXIT_OK


def _suggestion(name: str) -> str:
    from difflib import get_close_matches

    near = get_close_matches(name, COMMANDS, n=1)
    return f"Did you mean `fieldkit {near[0]}`?" if near else "`fieldkit --help` lists the commands."
