"""Help: every command has a page, and examples that the command would take. Completion: what the Tab key offers."""

import inspect
import shlex
from pathlib import Path

import pytest
import typer

from fieldkit.cli.main import COMMAND_GROUPS, COMMANDS, command_of, function_of, main

ROOT = Path(__file__).parents[2]


def examples(name: str) -> list[str]:
    """The command lines that a command's docstring gives as examples."""
    text = inspect.cleandoc(function_of(name).__doc__ or "")
    block = next(block for block in text.split("\n\n") if block.startswith("Example"))
    lines = block.partition(":")[2].strip("\n")
    # "Example: fieldkit …" may run over lines of the docstring, and is one line of the shell's.
    return lines.splitlines() if lines.startswith("    ") else [" ".join(lines.split())]


def fieldkits(line: str) -> list[str]:
    """The words behind "fieldkit" of an example's command, without what the shell does with the output."""
    words = shlex.split(line)
    end = next((k for k, word in enumerate(words) if word in {"|", ">", ">>", "&&"}), len(words))
    return words[1:end] if words[0] == "fieldkit" else []


@pytest.mark.parametrize("name", COMMANDS)
def test_examples_are_there_and_parse(name: str) -> None:
    own = 0
    for words in filter(None, map(fieldkits, examples(name))):
        command = " ".join(words[:2]) if " ".join(words[:2]) in COMMANDS else words[0]
        command_of(command).make_context(f"fieldkit {command}", words[len(command.split()) :])  # raises if it does not
        own += command == name
    assert own >= 1


def test_an_example_that_does_not_parse_is_found() -> None:
    with pytest.raises(typer.TyperException):
        command_of("doctor").make_context("fieldkit doctor", ["--colour"])


@pytest.mark.parametrize("name", COMMANDS)
def test_page(name: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "100")
    assert main([*name.split(), "--help"]) == 0
    text = capsys.readouterr().out
    for words in (f"Usage: fieldkit {name} ", "Output", "--json", "--debug"):
        assert words in text
    for param in command_of(name).params:
        assert param.opts[0] in text
    assert f"fieldkit {name}" in (ROOT / "docs" / "commands" / f"{name.split()[0]}.md").read_text()


def test_every_command_stands_under_its_stage_once() -> None:
    assert [name for names in COMMAND_GROUPS.values() for name in names] == list(COMMANDS)


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("fieldkit ex", {"export-mission"}),
        ("fieldkit scene ", {"from-reference", "new", "show"}),
        ("fieldkit plan --fidelity ", {"draft", "standard", "fine"}),
        ("fieldkit plan --method ci", {"circle"}),
        ("fieldkit cache ", {"show", "prune", "clear"}),
        ("fieldkit export-mission plan --vehicle px4-g", {"px4-gimbal"}),
        ("fieldkit simulate test-case-5", {"test-case-5"}),
    ],
)
def test_the_tab_key(line, offered, monkeypatch, capsys) -> None:
    for name, value in (("_FIELDKIT_COMPLETE", "complete_bash"), ("COMP_WORDS", line), ("COMP_CWORD", line.count(" "))):
        monkeypatch.setenv(name, str(value))
    main([])
    assert set(capsys.readouterr().out.split()) == offered
