"""Options of a command in groups: a parameter that is a dataclass of options stands for all of its fields."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from copy import copy
from dataclasses import fields, is_dataclass
from typing import Annotated, Any, TypeVar, get_args, get_type_hints

_Result = TypeVar("_Result")


def grouped(command: Callable[..., _Result]) -> Callable[..., _Result]:
    """A command as Typer takes it, with each parameter that is a dataclass replaced by that class' fields.

    Each field is annotated as a parameter would be, and has a default. A class variable ``panel`` is the heading in
    help of those of its options that name none.
    """
    groups: dict[str, type[Any]] = {}
    parameters: list[inspect.Parameter] = []
    for parameter in inspect.signature(command, eval_str=True).parameters.values():
        group = parameter.annotation
        if not is_dataclass(group):
            parameters.append(parameter)
            continue
        assert isinstance(group, type)
        groups[parameter.name] = group
        hints = get_type_hints(group, include_extras=True)
        panel = getattr(group, "panel", None)
        parameters += [
            inspect.Parameter(each.name, parameter.kind, default=each.default, annotation=_in(panel, hints[each.name]))
            for each in fields(group)
        ]

    signature = inspect.Signature(parameters)

    def flat(*args: Any, **options: Any) -> _Result:
        given = signature.bind(*args, **options)
        given.apply_defaults()
        values = given.arguments
        made = {
            name: group(**{each.name: values.pop(each.name) for each in fields(group)})
            for name, group in groups.items()
        }
        return command(**made, **values)

    flat.__name__, flat.__doc__ = command.__name__, command.__doc__
    flat.__signature__ = signature  # type: ignore[attr-defined]
    flat.__annotations__ = {}
    return flat


def _in(panel: str | None, annotation: Any) -> Any:
    kind, option = get_args(annotation)
    own = copy(option)  # others may share it
    own.rich_help_panel = option.rich_help_panel or panel
    return Annotated[kind, own]
