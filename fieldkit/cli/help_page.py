"""The help page of a command, laid out as a manual page: what it does, options in groups, examples, exit codes.

A command's docstring holds the text. Blocks that begin with one of `SECTIONS` and a colon go behind the options:
examples, a command line each; files and exit codes, "term  what it is", two spaces between; see also.

Lines of examples stay as they are, so that they can be copied; what is too long for the terminal is continued with a
backslash. Options stand in groups by Typer's ``rich_help_panel``. Imports Typer and the standard library only.
"""

from __future__ import annotations

import inspect
import re
import textwrap
from collections.abc import Callable, Sequence
from typing import Any

from typer.core import TyperArgument, TyperCommand, TyperOption

SECTIONS = ("Examples", "Files", "Exit codes", "See Also")
RUN, OUTPUT = "Run", "Output"
_LAST_GROUPS = (RUN, OUTPUT)  # of all commands, behind a command's own
_HEADING = re.compile(rf"(Example|{'|'.join(SECTIONS)}): *")
_KINDS = {"int": "N", "float": "X", "int range": "N", "float range": "X", "path": "PATH", "str": "TEXT"}
_LONGEST_CHOICE = 24


def split_docstring(text: str) -> tuple[str, dict[str, list[str]]]:
    """What a command does, and the lines of its sections by title; "Example" is an "Examples"."""
    prose, sections = [], {}
    for block in re.split(r"\n\s*\n", inspect.cleandoc(text)):
        heading = _HEADING.match(block)
        if heading is None:
            prose.append(block)
            continue
        rest = block[heading.end() :]
        lines = textwrap.dedent(rest).strip("\n").splitlines()
        title = "Examples" if heading[1] == "Example" else heading[1]
        # "Example: fieldkit …" may run over lines of the docstring, and is one line of the shell's.
        sections[title] = lines if rest.startswith("\n") else [" ".join(line.strip() for line in lines)]
    return "\n\n".join(prose), sections


def examples(command: Callable[..., object]) -> list[str]:
    """The command lines that a command's docstring gives as examples."""
    return split_docstring(command.__doc__ or "")[1].get("Examples", [])


class HelpPage(TyperCommand):
    """A Typer command whose help is a page as above."""

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        pieces = []
        for param in self.get_params(ctx):
            if isinstance(param, TyperArgument):
                name = argument_word(param)
                pieces.append(name if param.required else f"[{name}]")
            elif isinstance(param, TyperOption) and param.required:
                pieces.append(f"{min(param.opts, key=len)} {value_word(param, ctx)}")
        return [*pieces, "[OPTIONS]"]

    def format_help_text(self, ctx: Any, formatter: Any) -> None:
        formatter.write_paragraph()
        with formatter.indentation():
            formatter.write_text(split_docstring(self.help or "")[0])

    def format_options(self, ctx: Any, formatter: Any) -> None:
        arguments, groups = [], dict[str, list[tuple[str, str]]]()
        for param in self.get_params(ctx):
            record = param.get_help_record(ctx)
            if record is None:
                continue
            if isinstance(param, TyperArgument):
                arguments.append((argument_word(param), record[1].replace("[required]", "").rstrip()))
            elif isinstance(param, TyperOption):
                is_help = "--help" in param.opts
                group = OUTPUT if is_help else getattr(param, "rich_help_panel", None) or "Options"
                groups.setdefault(group, []).append(_record(param, record, ctx))
        if arguments:
            with formatter.section("Arguments"):
                formatter.write_dl(arguments)
        last = [group for group in _LAST_GROUPS if group in groups]
        for group in [*(group for group in groups if group not in last), *last]:
            with formatter.section(group):
                formatter.write_dl(groups[group])

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        sections = split_docstring(self.help or "")[1]
        for title in (title for title in SECTIONS if title in sections):
            with formatter.section(title.capitalize()):
                if title == "Examples":
                    for line in sections[title]:
                        formatter.write(_shell_lines(line, formatter.width, formatter.current_indent) + "\n")
                elif title == "See Also":
                    formatter.write_text(" ".join(sections[title]))
                else:
                    formatter.write_dl(_pairs(sections[title]))


def value_word(param: TyperOption | TyperArgument, ctx: Any) -> str:
    """What stands for an option's value in help: PATH, N, a metavar, or the choices where they are few."""
    kind = param.display_type_rich(ctx) or ""
    if param.metavar is not None:
        return kind
    many = len(kind) > _LONGEST_CHOICE
    return _KINDS.get(kind.strip("<>"), name_word(param) if many else kind.strip("<>"))


def argument_word(param: TyperArgument) -> str:
    """What stands for an argument: its metavar, or its name in capitals; "..." where it may be given several times."""
    return param.metavar or name_word(param) + ("..." if param.nargs != 1 else "")


def name_word(param: TyperOption | TyperArgument) -> str:
    """A parameter's name in capitals, as a word for its value."""
    return (param.name or "").upper().replace("_", "-").strip("-")


def _record(param: TyperOption, record: tuple[str, str], ctx: Any) -> tuple[str, str]:
    """An option's line: its names and value word, and its help, with the choices where the word does not hold them."""
    names, text = record
    if param.is_flag:
        return record
    kind = param.display_type_rich(ctx) or ""
    word = value_word(param, ctx)
    if param.metavar is None and kind and "|" in kind and "|" not in word:
        help_text, bracket, facts = text.partition("  [")
        text = f"{help_text} One of: {', '.join(kind.strip('<>').split('|'))}.{bracket}{facts}"
    return names.replace(kind, word) if kind else names, text


def _shell_lines(line: str, width: int, indent: int) -> str:
    """A command line, continued with backslashes where it is longer than the width."""
    margin = " " * indent
    if indent + len(line) <= width:
        return margin + line
    # A break must not part an option from its value: a space before "-" is the place for it.
    parts, rows = re.split(r" (?=-)", line), [""]
    for part in parts:
        joined = f"{rows[-1]} {part}" if rows[-1] else part
        if rows[-1] and indent + len(joined) + 2 > width - (4 if len(rows) > 1 else 0):
            rows.append(part)
        else:
            rows[-1] = joined
    return f" \\\n{margin}    ".join(rows).join([margin, ""])


def _pairs(lines: Sequence[str]) -> list[tuple[str, str]]:
    """Lines "term  what it is" as pairs; an indented line goes on with the one before."""
    pairs: list[tuple[str, str]] = []
    for line in lines:
        if line.startswith(" ") and pairs:
            pairs[-1] = (pairs[-1][0], f"{pairs[-1][1]} {line.strip()}")
        else:
            term, _, meaning = line.partition("  ")
            pairs.append((term, meaning.strip()))
    return pairs
