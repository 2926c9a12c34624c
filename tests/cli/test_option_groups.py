"""Options in groups: a command's parameters for Typer, and what the command is called with."""

from __future__ import annotations

import inspect
from dataclasses import dataclass
from typing import Annotated, ClassVar

import typer

from fieldkit.cli.main import grouped, parser_of

called: list[tuple[object, ...]] = []


@dataclass(frozen=True)
class Size:
    """Of something."""

    width: Annotated[int, typer.Option("--wide")] = 3
    names: Annotated[list[str] | None, typer.Option("--name")] = None


Shared = Annotated[int, typer.Option("--shared")]
Placed = Annotated[int, typer.Option("--placed", rich_help_panel="Elsewhere")]


@dataclass(frozen=True)
class Run:
    """With a heading in help."""

    panel: ClassVar[str] = "Run"

    shared: Shared = 0
    placed: Placed = 0


def command(first: Annotated[str, typer.Option("--first")], size: Size, last: bool = False) -> None:
    """Do it."""
    called.append((first, size, last))


def test_fields_stand_in_the_group_s_place_and_come_back_as_the_group() -> None:
    assert list(inspect.signature(grouped(command)).parameters) == ["first", "width", "names", "last", "debug"]
    assert grouped(command).__doc__ == "Do it."
    parser_of(command).main(["--first", "a", "--wide", "5", "--name", "b", "--name", "c"], standalone_mode=False)
    parser_of(command).main(["--first", "a", "--last"], standalone_mode=False)
    grouped(command)("a", width=4)
    assert called == [("a", Size(5, ["b", "c"]), False), ("a", Size(), True), ("a", Size(4), False)]


def test_a_group_has_a_heading_for_options_that_name_none() -> None:
    def ends(run: Run, other: Shared = 0) -> int:
        return run.placed

    parser = parser_of(ends)
    assert {p.name: getattr(p, "rich_help_panel", None) for p in parser.params} == {
        "shared": "Run", "placed": "Elsewhere", "other": None, "debug": "Output",
    }  # fmt: skip
    assert parser.main(["--placed", "4"], standalone_mode=False) == 4
