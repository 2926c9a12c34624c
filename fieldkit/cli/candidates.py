"""What may stand next on a command line: the answer to the Tab key.

The shells' scripts (fieldkit/cli/shells) ask ``fieldkit __complete WORD…`` with the words behind "fieldkit", the last
one being the one under the cursor, possibly empty. Imports nothing heavy.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from typer.core import TyperArgument, TyperCommand, TyperOption

FILES = ":files"

Parameter = TyperOption | TyperArgument
Choices = list[tuple[str, str]]


@dataclass(frozen=True)
class Candidates:
    """Words that fit, each with a few words about it (maybe none), and whether names of files fit too."""

    words: tuple[tuple[str, str], ...] = ()
    files: bool = False

    def text(self) -> str:
        """A line per word, "WORD", a tab, what it is; where files fit, a last line ":files"."""
        lines = [f"{word}\t{about}" if about else word for word, about in self.words]
        return "".join(f"{line}\n" for line in [*lines, *([FILES] if self.files else [])])


def candidates(words: Sequence[str], commands: Mapping[str, str], load: Callable[[str], TyperCommand]) -> Candidates:
    """What fits in the place of the last word.

    Args:
        words: those behind "fieldkit"; the last is the one to complete.
        commands: each command's name, of one or two words, and what it does.
        load: gives the parser of a command.
    """
    *before, partial = words or [""]
    if before[:1] == ["help"]:
        return _fitting(_names(before[1:], commands), partial)
    if not before:
        own = [("help", "Explain a command."), ("--help", "List the commands."), ("--version", "Show the version.")]
        return _fitting([*_names([], commands), *own], partial)
    for length in (2, 1):
        name = " ".join(before[:length])
        if len(before) >= length and name in commands:
            return _of_command(load(name), before[length:], partial)
    return _fitting([*_names(before, commands), ("--help", "")], partial)


def _names(before: Sequence[str], commands: Mapping[str, str]) -> Choices:
    """The next word of the commands' names."""
    found: dict[str, list[str]] = {}
    for name in commands:
        parts = name.split()
        if parts[: len(before)] == list(before) and len(parts) > len(before):
            found.setdefault(parts[len(before)], []).append(name)
    return [
        (word, commands[names[0]] if len(names) == 1 else ", ".join(name.split()[-1] for name in names))
        for word, names in found.items()
    ]


def _of_command(command: TyperCommand, before: Sequence[str], partial: str) -> Candidates:
    options = {opt: param for param in command.params if isinstance(param, TyperOption) for opt in param.opts}
    arguments = [param for param in command.params if isinstance(param, TyperArgument)]
    given, places, waiting, closed = _read(before, options)
    if waiting is not None:
        return _fitting(*_values(waiting, partial))
    if partial.startswith("--") and "=" in partial and not closed:
        name, _, value = partial.partition("=")
        if name not in options:
            return Candidates()
        found = _fitting(*_values(options[name], value))
        return Candidates(tuple((f"{name}={word}", about) for word, about in found.words), found.files)
    place = arguments[min(places, len(arguments) - 1)] if arguments else None
    if place is not None and places >= len(arguments) and place.nargs != -1:
        place = None
    if not closed and (partial.startswith("-") or place is None):
        return _fitting(list(_option_names(command, given)), partial)
    return _fitting(*_values(place, partial)) if place is not None else Candidates()


def _read(words: Sequence[str], options: Mapping[str, TyperOption]) -> tuple[set[str], int, TyperOption | None, bool]:
    """Names of the parameters given, how many arguments, the option whose value is next, and whether -- has been."""
    given: set[str] = set()
    places, waiting, closed = 0, None, False
    for word in words:
        if waiting is not None:
            waiting = None
        elif closed or not word.startswith("-") or word == "-":
            places += 1
        elif word == "--":
            closed = True
        else:
            name, equals, _ = word.partition("=")
            param = options.get(name)
            if param is None and not word.startswith("--"):
                param, equals = options.get(word[:2]), word[2:]  # -n12
            if param is not None:
                given.add(param.name or "")
                waiting = None if param.is_flag or equals else param
    return given, places, waiting, closed


def _option_names(command: TyperCommand, given: set[str]) -> Iterator[tuple[str, str]]:
    """The long names of options, those that must be given first; none that stands there already."""
    options = [param for param in command.params if isinstance(param, TyperOption) and not param.hidden]
    for param in sorted(options, key=lambda param: not param.required):
        if param.name not in given or param.multiple:
            yield max(param.opts, key=len), param.help or ""
    yield "--help", "Explain the command."


def _values(param: Parameter, partial: str) -> tuple[Choices, str, bool]:
    """The values a parameter takes, what is typed of it, and whether files are among them."""
    kind = param.type_descriptor
    if kind.choices is not None:
        return [(str(choice), "") for choice in kind.choices], partial, False
    known = _KNOWN.get(param.name or "")
    if known is not None:
        return [(name, "") for name in known()], partial, True
    return [], partial, kind.annotation is Path


def _vehicles() -> list[str]:
    from fieldkit.vehicles.vehicle_file import vehicle_names

    return vehicle_names()


def _scenes() -> list[str]:
    from fieldkit.scenes.library import scene_names

    return scene_names()


# Parameters, by their name in the command's function, that take one of fieldkit's own names or a file.
_KNOWN: dict[str, Callable[[], list[str]]] = {
    "vehicle": _vehicles,
    "scene": _scenes,
    "scenes": _scenes,
    "onto": _scenes,
}


def _fitting(found: Choices, partial: str, files: bool = False) -> Candidates:
    return Candidates(tuple((word, about) for word, about in found if word.startswith(partial)), files)
