"""Help as a manual page: its layout, and examples that the command would take."""

from __future__ import annotations

import re
import shlex
from importlib import import_module

import pytest
import typer
from hypothesis import given, settings
from hypothesis import strategies as st

from fieldkit.cli.help_page import HelpPage, _shell_lines, examples, split_docstring
from fieldkit.cli.main import COMMANDS, STAGES, main, module_name, overview, typer_command


def page(name: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setenv("COLUMNS", "80")
    assert main([*name.split(), "--help"]) == 0
    return capsys.readouterr().out


def fieldkits(line: str) -> list[str]:
    """The words behind "fieldkit" of an example's command, without what the shell does with the output."""
    words = shlex.split(line)
    end = next((k for k, word in enumerate(words) if word in {"|", ">", ">>", "&&"}), len(words))
    return words[1:end] if words[0] == "fieldkit" else []


@pytest.mark.parametrize("name", COMMANDS)
def test_examples_are_there_and_parse(name: str) -> None:
    found = examples(import_module(f"fieldkit.cli.{module_name(name)}").command)
    own = 0
    for line in found:
        words = fieldkits(line)
        if not words:
            continue
        command = " ".join(words[:2]) if " ".join(words[:2]) in COMMANDS else words[0]
        arguments = words[len(command.split()) :]
        typer_command(command).make_context(f"fieldkit {command}", arguments)  # raises where it does not parse
        own += command == name
    assert own >= 1


def test_an_example_that_does_not_parse_is_found() -> None:
    with pytest.raises(typer.TyperException):
        typer_command("doctor").make_context("fieldkit doctor", ["--colour"])


@pytest.mark.parametrize("name", COMMANDS)
def test_page(name: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    text = page(name, capsys, monkeypatch)
    assert max(map(len, text.splitlines())) <= 80
    assert text.startswith(f"Usage: fieldkit {name} ")
    headings = re.findall(r"(?m)^(\S.*):$", text)
    assert len(headings) == len(set(headings))
    assert headings.index("Output") < headings.index("Examples")
    assert headings[-1] in {"Examples", "Files", "Exit codes", "See also"}
    assert "<int" not in text
    assert "<path>" not in text
    _, _, also = text.partition("See also:\n")
    for other in re.findall(r"fieldkit ([a-z-]+(?: [a-z-]+)?)", also):
        assert other in COMMANDS or other.split()[0] in {known.split()[0] for known in COMMANDS}, other
    _, _, codes = text.partition("Exit codes:\n")
    if codes:
        assert [int(n) for n in re.findall(r"(?m)^  (\d)  ", codes.partition("\n\n")[0])] == sorted(
            {int(n) for n in re.findall(r"(?m)^  (\d)  ", codes.partition("\n\n")[0])}
        )


def test_the_overview_shows_every_command_under_its_stage() -> None:
    text = overview()
    for stage, commands in STAGES.items():
        block = text.partition(f"\n{stage}:\n")[2].partition("\n\n")[0]
        assert [line.strip().split("  ")[0] for line in block.splitlines()] == list(commands)
    assert sum(map(len, STAGES.values())) == len(COMMANDS)


def test_a_page_of_every_kind_of_parameter(capsys: pytest.CaptureFixture[str]) -> None:
    def probe(
        place: str,
        count: int = typer.Option(3, "--count", "-c", min=1, help="How many."),
        kind: str = typer.Option(..., "--kind", metavar="WORD", help="Which."),
        slow: bool = typer.Option(False, "--slow", rich_help_panel="Run", help="Take long."),
    ) -> None:
        """Probe it.

        A paragraph.

        Examples:
            fieldkit probe here --kind a | wc

        Files:
            here  what is
                probed
            there  not

        Exit codes:
            0  done

        See Also:
            fieldkit doctor
        """

    app = typer.Typer(add_completion=False, rich_markup_mode=None)
    app.command(cls=HelpPage)(probe)
    parser = typer.main.get_command(app)
    parser.main(args=["--help"], prog_name="fieldkit probe", standalone_mode=False)
    assert (
        capsys.readouterr().out
        == """\
Usage: fieldkit probe PLACE --kind WORD [OPTIONS]

  Probe it.

  A paragraph.

Arguments:
  PLACE

Options:
  -c, --count N  How many.  [default: 3; x>=1]
  --kind WORD    Which.  [required]

Run:
  --slow  Take long.

Output:
  --help  Show this message and exit.

Examples:
  fieldkit probe here --kind a | wc

Files:
  here   what is probed
  there  not

Exit codes:
  0  done

See also:
  fieldkit doctor
"""
    )


def test_a_docstring_with_one_example_in_the_text() -> None:
    prose, sections = split_docstring("Do it.\n\n    More.\n\n    Example: fieldkit do --it\n    -o there\n    ")
    assert prose == "Do it.\n\nMore."
    assert sections == {"Examples": ["fieldkit do --it -o there"]}


word = st.text("abcdefgh./", min_size=1, max_size=30)
option = st.builds(lambda name, value: f"--{name} {value}", word, word)


@given(st.lists(st.one_of(word, option), min_size=1, max_size=12), st.integers(40, 100))
@settings(deadline=None, max_examples=100)
def test_a_continued_line_is_the_same_to_the_shell(parts: list[str], width: int) -> None:
    line = "fieldkit " + " ".join(parts)
    drawn = _shell_lines(line, width, 2)
    assert shlex.split(drawn.replace("\\\n", " ")) == shlex.split(line)
    for row in drawn.splitlines():
        assert len(row) <= width or " -" not in row.strip().removesuffix(" \\")[1:]
