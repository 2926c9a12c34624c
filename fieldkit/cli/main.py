"""The `fieldkit` command: a Typer group that imports a subcommand's file when it is wanted.

This module and the files of the commands import Typer and the standard library only: the library is imported when a
command runs.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from fieldkit.cli.boundary import Boundary
from fieldkit.cli.given import check_given
from fieldkit.cli.options import grouped
from fieldkit.errors import EXIT_OK
from fieldkit.version import __version__

# By stage of the work. A command is the function `command` in fieldkit/cli/<name>.py; one of two words is the function
# <first>_<second> in fieldkit/cli/<first>.py.
COMMAND_GROUPS: dict[str, tuple[str, ...]] = {
    "Plan, once for a field": ("plots", "reference", "scene from-reference", "plan"),
    "Fly": ("export-mission", "check-mission", "upload"),
    "Check and score, every date": ("geotag", "check", "evaluate"),
    "Many plots and dates, results": (
        "campaign init",
        "campaign show",
        "campaign export",
        "report",
    ),
    "Simulate": ("demo", "scene new", "scene show", "simulate"),
    "This machine": ("doctor", "cache"),
}
COMMANDS: dict[str, str] = {name: stage for stage, names in COMMAND_GROUPS.items() for name in names}
"""Every command, and the stage it stands under."""
_GROUPS = {
    "scene": "Scenes of simulated plots: new ones, those of fieldkit, and those made from a reference.",
    "campaign": "One plan over many plots and dates: make it, look at it, export it.",
}
_HELP = {"help_option_names": ["--help", "-h"]}


class Parser(TyperCommand):
    """A command that runs with its libraries' threads limited and a temporary folder of its own."""

    def invoke(self, ctx: Any) -> Any:
        from fieldkit.runtime.temporary import temporary_folder
        from fieldkit.runtime.threads import set_memory_environment, set_thread_environment

        set_thread_environment()  # before anything imports NumPy
        set_memory_environment()
        if isinstance(ctx.obj, Boundary):
            ctx.obj.resumable = any(param.name == "resume" for param in self.params)
        check_given(ctx.command_path.removeprefix("fieldkit "), ctx.params)
        with temporary_folder():
            return super().invoke(ctx)


class Commands(TyperGroup):
    """The commands whose names begin with ``words``, each imported when it is looked up."""

    words = ""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        names = (name.removeprefix(self.words).split()[0] for name in COMMANDS if name.startswith(self.words))
        self.commands = dict.fromkeys(names)  # type: ignore[assignment]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        if cmd_name not in self.commands:
            return None
        name = self.words + cmd_name
        return command_of(name) if name in COMMANDS else _group(cmd_name, _GROUPS[cmd_name])


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command line and give its exit code."""
    arguments = list(sys.argv[1:] if arguments is None else arguments) or ["--help"]
    with Boundary(arguments) as boundary:
        result = program().main(args=arguments, prog_name="fieldkit", standalone_mode=False, obj=boundary)
        boundary.exit_code = result if isinstance(result, int) else EXIT_OK
    return boundary.exit_code


def program() -> Any:
    """The whole command line."""
    app = typer.Typer(cls=Commands, rich_markup_mode="rich", context_settings=_HELP)
    app.callback(help=_page(_fieldkit))(_fieldkit)
    return typer.main.get_command(app)


def command_of(name: str) -> Parser:
    """The parser of a command and its options; imports the command's file."""
    return parser_of(function_of(name), name.split()[-1], COMMANDS[name])


def function_of(command: str) -> Callable[..., int | None]:
    """A command's function; imports its file."""
    name = "_".join(command.split()) if " " in command else "command"
    function: Callable[..., int | None] = getattr(import_module(module_name(command)), name.replace("-", "_"))
    return function


def parser_of(command: Callable[..., int | None], name: str | None = None, stage: str | None = None) -> Parser:
    """The parser of a command's function, under a heading of the overview."""
    app = typer.Typer(add_completion=False, rich_markup_mode="rich", pretty_exceptions_enable=False)
    made = app.command(name, cls=Parser, help=_page(command), rich_help_panel=stage, context_settings=_HELP)
    made(grouped(command))
    parser = typer.main.get_command(app)
    assert isinstance(parser, Parser)
    return parser


def module_name(command: str) -> str:
    """The module that holds a command."""
    return f"fieldkit.cli.{command.split()[0].replace('-', '_')}"


def _group(name: str, says: str) -> Any:
    class Subcommands(Commands):
        words = f"{name} "

    app = typer.Typer(cls=Subcommands, add_completion=False, rich_markup_mode="rich", context_settings=_HELP)
    app.callback(help=says, no_args_is_help=True)(lambda: None)
    group = typer.main.get_command(app)
    group.name = name
    group.rich_help_panel = next(COMMANDS[known] for known in COMMANDS if known.startswith(f"{name} "))  # type: ignore[attr-defined]
    return group


def _page(command: Callable[..., object]) -> str:
    """A command's docstring for Typer: paragraphs as one line each, examples as they are, no brackets as markup.

    The section Args is told beside each option.
    """
    blocks = [block for block in inspect.cleandoc(command.__doc__ or "").split("\n\n") if block[:5] != "Args:"]
    text = "\n\n".join(block if block.startswith("Example") else " ".join(block.split()) for block in blocks)
    return text.replace("[", r"\[")


def _version(asked: bool) -> None:
    if asked:
        sys.stdout.write(f"fieldkit {__version__}\n")
        raise typer.Exit


def _fieldkit(
    version: Annotated[
        bool, typer.Option("--version", "-V", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Photographs of field plots: where to take them, how to fly there, and what they are worth.

    Every command takes --json (one JSON object on stdout, nothing else there) and --debug (tracebacks).

    Exit codes: 0 done, 1 a bug in fieldkit, 2 wrong usage, 3 bad input, 4 reconstruction failed, 5 mission unsafe or
    not for this vehicle, 6 vehicle link failed, 130 interrupted, 143 ended by SIGTERM.
    """
