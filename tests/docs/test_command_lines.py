"""Every command line of README and docs is one that fieldkit, the benchmarks, make or pytest take."""

import re
from pathlib import Path

import pytest

from benchmarks.__main__ import command as benchmarks
from fieldkit.cli.main import COMMANDS, command_of, parser_of
from tests.cli.test_help import fieldkits

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")), *sorted((ROOT / "missions").rglob("*.md"))]
TARGETS = set(re.findall(r"(?m)^([a-z-]+):", (ROOT / "Makefile").read_text("utf-8")))


def lines(page: Path) -> list[str]:
    """The command lines of a page's blocks of code; a backslash joins two, and what follows "…" is left out."""
    text = page.read_text("utf-8").replace("\\\n", " ")
    fenced = re.findall(r"(?ms)^```(?:console|sh|bash)?\n(.*?)^```", text)
    blocks = [line for block in fenced for line in block.splitlines()]
    blocks += re.findall(r"(?m)^    (.*)$", text)
    told = (re.sub(r"^\$ |\s+#.*$", "", line.strip()) for line in blocks)
    return [line for line in told if re.match(r"(fieldkit|python -m benchmarks|make|pytest) ", line)]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_command_line_is_taken(page: Path) -> None:
    for line in lines(page):
        words = line.split()
        if words[0] == "make":
            assert {word for word in words[1:] if "=" not in word} <= TARGETS, line
        elif words[0] == "pytest":
            assert all((ROOT / word).exists() for word in words[1:] if word.startswith("tests/")), line
        elif words[0] == "python" and "|" not in line:  # else what there is to choose
            parser_of(benchmarks).make_context("benchmarks", words[3:])
        elif words[0] == "fieldkit" and "…" not in line and words[1] in {name.split()[0] for name in COMMANDS}:
            given = fieldkits(line)
            name = " ".join(given[:2]) if " ".join(given[:2]) in COMMANDS else given[0]
            command_of(name).make_context(name, given[len(name.split()) :])
