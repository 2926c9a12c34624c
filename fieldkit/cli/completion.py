"""fieldkit completion."""

from __future__ import annotations

import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

from typer import Argument

from fieldkit.cli.common import DebugOption, JsonOption, emit_json

_SCRIPTS = Path(__file__).with_name("shells")


class Shell(StrEnum):
    """Whose script."""

    BASH = "bash"
    ZSH = "zsh"
    FISH = "fish"


def command(
    shell: Annotated[Shell, Argument(help="bash, zsh or fish.")],
    as_json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Print the script by which a shell completes fieldkit's commands with the Tab key.

    Commands, options, values such as standard or circle, the names of vehicles and scenes, and files are completed.
    The script asks the fieldkit that stands on the command line, so it stays true when fieldkit is updated. Nothing is
    installed: the shell's own file has to take the script in, as the examples do.

    Examples:
        echo 'eval "$(fieldkit completion bash)"' >> ~/.bashrc
        echo 'eval "$(fieldkit completion zsh)"' >> ~/.zshrc
        fieldkit completion fish > ~/.config/fish/completions/fieldkit.fish

    Exit codes:
        0  done
        2  wrong usage

    See Also:
        fieldkit doctor
    """
    script = script_of(shell)
    if as_json:
        emit_json({"shell": shell.value, "script": script})
    else:
        sys.stdout.write(script)


def script_of(shell: Shell) -> str:
    """The script of a shell."""
    return (_SCRIPTS / f"fieldkit.{shell.value}").read_text(encoding="utf-8")
