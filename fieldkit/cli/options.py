"""Typer's parameters, made of what commands and classes of settings say of themselves: each text stands once."""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
from collections.abc import Callable, Iterator, Mapping
from copy import copy
from dataclasses import fields
from itertools import pairwise
from typing import Annotated, Any, TypeVar, get_args, get_origin, get_type_hints

from typer import Argument, Option
from typer.models import OptionInfo

from fieldkit.cli.common import DebugOption
from fieldkit.errors import UsageError

Panels = Mapping[str | None, Mapping[str, Any]]
"""Options of a class of settings by their heading in help and by field: a `typer.Option`, ``Annotated[type, option]``
where Typer needs another type, or None for a plain one."""
Result = TypeVar("Result")
_KEYWORD = inspect.Parameter.KEYWORD_ONLY


def grouped(command: Callable[..., Result]) -> Callable[..., Result]:
    """A command as Typer takes it: with --debug, and options in the place of a parameter that is a class of settings.

    A parameter's help is what the section Args of the command's docstring says, a field's the text under it. Both are
    options of their names where they are not annotated with a `typer.Option`; a parameter without a default that may
    be given by its place is an argument. A dataclass of a command has an option for every field, under the heading
    ``panel``. Settings of the library are ``Annotated[Settings, panels]``; fields that nobody gives are left to them.
    """
    groups: dict[str, tuple[type, list[str]]] = {}
    parameters: list[inspect.Parameter] = []
    texts = argument_texts(command)
    for parameter in inspect.signature(command, eval_str=True).parameters.values():
        kind, info = _parts(parameter.annotation)
        if hasattr(kind, "__dataclass_fields__") or hasattr(kind, "model_fields"):
            options = [option.replace(kind=parameter.kind) for option in _options(kind, info)]
            groups[parameter.name] = kind, [option.name for option in options]
            parameters += options
        else:
            by_place = parameter.default is parameter.empty and parameter.kind is not _KEYWORD
            info = info or (Argument() if by_place else Option())
            parameters.append(_parameter(parameter, kind, info, texts.get(parameter.name)))
    parameters.append(inspect.Parameter("debug", _KEYWORD, default=False, annotation=DebugOption))
    signature = inspect.Signature(parameters)

    def flat(*args: Any, **options: Any) -> Result:
        bound = signature.bind(*args, **options)
        bound.apply_defaults()
        values = bound.arguments
        del values["debug"]  # the boundary looks for it
        made = {
            name: _made(kind, {option: values.pop(option) for option in names})
            for name, (kind, names) in groups.items()
        }
        return command(**made, **values)

    flat.__name__, flat.__doc__ = command.__name__, command.__doc__
    flat.__signature__ = signature  # type: ignore[attr-defined]
    flat.__annotations__ = {}
    return flat


def argument_texts(command: Callable[..., object]) -> dict[str, str]:
    """What a docstring's section Args says, by parameters."""
    section = inspect.cleandoc(command.__doc__ or "").partition("\nArgs:\n")[2].partition("\n\n")[0]
    return dict(re.findall(r"(?ms)^    (\w+): (.*?)(?=^    \w|\Z)", section))


def attribute_texts(owner: type) -> dict[str, str]:
    """The texts under the attributes of a class and of its bases in fieldkit, by attributes."""
    texts = {}
    for base in reversed(owner.__mro__):
        if base.__module__.startswith("fieldkit"):
            (found,) = ast.parse(textwrap.dedent(inspect.getsource(base))).body
            for attribute, text in pairwise(found.body):  # type: ignore[attr-defined]
                match attribute, text:
                    case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(said))):
                        texts[name] = said
    return texts


def _options(owner: Any, panels: Panels | None) -> Iterator[inspect.Parameter]:
    """The options of a class of settings, or of a command's dataclass."""
    hints, texts = get_type_hints(owner, include_extras=True), attribute_texts(owner)
    for panel, options in (
        panels or {getattr(owner, "panel", None): dict.fromkeys(field.name for field in fields(owner))}
    ).items():
        for name, option in options.items():
            kind, info = _parts(hints[name])
            if isinstance(option, OptionInfo):
                info = option
            elif option is not None:
                kind, info = _parts(option)
            info = copy(info) if isinstance(info, OptionInfo) else Option()
            info.rich_help_panel = info.rich_help_panel or panel
            # A pydantic model has no attributes of its fields: what nobody gives is None, and its default is told.
            own = getattr(owner, "model_fields", {}).get(name) if name in owner.__annotations__ else None
            if own is not None and isinstance(own.default, str) and own.default:
                info.show_default = f"{own.default}"
            parameter = inspect.Parameter(name, _KEYWORD, default=getattr(owner, name, None))
            yield _parameter(parameter, kind, info, texts.get(name))


def _parts(annotation: Any) -> tuple[Any, Any]:
    """A type, and the first thing that it is annotated with."""
    return get_args(annotation)[:2] if get_origin(annotation) is Annotated else (annotation, None)


def _parameter(parameter: inspect.Parameter, kind: Any, info: Any, text: str | None) -> inspect.Parameter:
    own = copy(info)  # others may share it
    own.help = info.help or (text and " ".join(text.split()))
    if isinstance(own, OptionInfo) and own.default is ...:  # Typer's place of a first name; else it adds --no-NAME
        own.default = f"--{parameter.name.replace('_', '-')}"
    return parameter.replace(annotation=Annotated[kind, own])


def _made(kind: Any, values: Mapping[str, Any]) -> Any:
    """Settings of the values that are given. Raises UsageError: one is none for its field."""
    try:
        return kind(**{name: value for name, value in values.items() if value is not None})
    except ValueError as error:
        from fieldkit.documents.toml_file import sentence

        raise UsageError(sentence(error), remedy="--help explains the options.") from error  # type: ignore[arg-type]
