"""The `fieldkit` command: finds the subcommand's file and runs it.

This module and the files of the commands import nothing heavy, so that help is instant: the library is imported when
a command runs. Even Typer is imported only for a subcommand, and its own groups are not used: they import pydantic to
parse their options.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Sequence
from importlib import import_module
from typing import TYPE_CHECKING

from fieldkit.cli.boundary import Boundary
from fieldkit.errors import EXIT_OK, UsageError
from fieldkit.version import __version__

if TYPE_CHECKING:
    from fieldkit.cli.help_page import HelpPage

# By stage of the work; in each, name: one line for `fieldkit --help`. The command is the function `command` in
# fieldkit/cli/<name>.py; a name may be of two words, and its file is then <first>_<second>.py.
STAGES: dict[str, dict[str, str]] = {
    "Plan, once for a field": {
        "reference": "Build a plot's reference cloud from a dense capture.",
        "scene from-reference": "Make a scene of a reference's clouds, to plan on.",
        "plan": "Find the camera poses that reconstruct a plot best.",
    },
    "Fly": {
        "export-mission": "Write a plan as missions for a vehicle and its plots.",
        "check-mission": "Say what photographs a mission would really give.",
        "upload": "Bring a mission onto a vehicle, and make sure of it.",
        "replay": "Stand in for a vehicle, by the recording of a real one.",
    },
    "Check and score, every date": {
        "geotag": "Match photographs to a flight log, write their poses.",
        "check": "Before leaving the field: will the photographs do?",
        "evaluate": "Score new captures of one or many plots.",
    },
    "Many plots and dates, results": {
        "campaign init": "Make a campaign: one plan over many plots and dates.",
        "campaign plan": "Plan the next visit of every plot from its own last one.",
        "campaign show": "Show a campaign's plots, dates, ranking and drift.",
        "campaign export": "Write its table as CSV, GeoJSON or GeoPackage.",
        "compare": "Compare evaluations: what differs, what is noise.",
        "report": "Show results as one HTML file, with 3D views.",
    },
    "Simulate": {
        "demo": "Try fieldkit on a small simulated plot, in minutes.",
        "scene new": "Write a new scene file: plants, soil and light.",
        "scene show": "List fieldkit's own scenes, or draw one.",
        "simulate": "Photograph a simulated plot as a drone would.",
    },
    "This machine": {
        "doctor": "Check this machine: packages, renderer, memory.",
        "cache": "Show, prune or clear what runs keep for later ones.",
        "completion": "Print the script for completion with the Tab key.",
    },
}
COMMANDS = {name: line for commands in STAGES.values() for name, line in commands.items()}

_INTRODUCTION = """\
Usage: fieldkit COMMAND [OPTIONS] ...

  Photographs of field plots: where to take them, how to fly there, and what
  they are worth.
"""
_CLOSING = """
Options:
  --version  Show the version and exit.
  --help     Show this message and exit.

Every command takes --json (one JSON object on stdout, nothing else there) and
--debug (tracebacks). Exit codes: 0 done, 1 a bug in fieldkit, 2 wrong usage,
3 bad input, 4 reconstruction failed, 5 mission unsafe or not for this vehicle,
6 vehicle link failed, 130 interrupted, 143 ended by SIGTERM.

'fieldkit COMMAND --help' explains a command, with examples.
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command line and give its exit code."""
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    with Boundary(arguments) as boundary:
        boundary.exit_code = _dispatch(arguments, boundary)
    return boundary.exit_code


def overview() -> str:
    """What `fieldkit --help` prints."""
    stages = (f"\n{title}:\n{_list(commands)}" for title, commands in STAGES.items())
    return _INTRODUCTION + "".join(stages) + _CLOSING


def module_name(command: str) -> str:
    """The module in fieldkit.cli that holds a command."""
    return command.replace("-", "_").replace(" ", "_")


def typer_command(name: str) -> HelpPage:
    """The parser of a command and its options; imports the command's file."""
    return parser_of(import_module(f"fieldkit.cli.{module_name(name)}").command)


def parser_of(command: Callable[..., int | None]) -> HelpPage:
    """The parser of a command's function."""
    import typer

    from fieldkit.cli.help_page import HelpPage

    app = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
    app.command(cls=HelpPage, context_settings={"help_option_names": ["--help", "-h"]})(command)
    parser = typer.main.get_command(app)
    assert isinstance(parser, HelpPage)
    return parser


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
        case ["__complete", *words]:  # for the scripts that `fieldkit completion` prints
            from fieldkit.cli.candidates import candidates

            sys.stdout.write(candidates(words, COMMANDS, typer_command).text())
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
    from fieldkit.runtime.temporary import temporary_folder
    from fieldkit.runtime.threads import set_memory_environment, set_thread_environment

    set_thread_environment()  # before anything imports NumPy
    set_memory_environment()
    boundary.command = name
    parser = typer_command(name)
    boundary.resumable = any(param.name == "resume" for param in parser.params)
    with temporary_folder():
        result = parser.main(args=arguments, prog_name=f"fieldkit {name}", standalone_mode=False)
    return result if isinstance(result, int) else EXIT_OK


def _suggestion(name: str) -> str:
    from fieldkit.documents.mistaken import MISSPELT, nearest

    near = nearest(name, COMMANDS)
    return MISSPELT.looks_like.format(f"`fieldkit {near}`") if near else "`fieldkit --help` lists the commands."
