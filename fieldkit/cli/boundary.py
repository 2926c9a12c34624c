"""Where every exception of a command ends: one message for people, an exit code, JSON when asked for."""

from __future__ import annotations

import io
import logging
import os
import signal
import sys
import threading
import warnings
import weakref
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from types import FrameType, TracebackType
from typing import Any, TextIO

from fieldkit.errors import EXIT_INTERRUPTED, FieldkitError, MissionError, UsageError

EXIT_BUG = 1
"""Exit code of an error that nobody foresaw."""
EXIT_TERMINATED = 143
"""Exit code after SIGTERM: 128 and its number, as shells have it."""
_AGAIN_S = 0.5
"""Time after which SIGTERM is sent again where the first was swallowed, seconds."""
_NO_TEXT = ("surrogates not allowed", "unable to parse raw data as a unicode string")
"""What Python and pydantic say where a file's name in an unknown encoding is to be written into a result."""


class _Terminated(SystemExit):
    """SIGTERM came."""


class Boundary:
    """A context around a command: swallows what it raises and holds the exit code it stands for.

    Attributes:
        resumable: whether it takes --resume.
        exit_code: what the process should end with.
    """

    def __init__(self, arguments: Sequence[str]) -> None:
        options = arguments[: arguments.index("--")] if "--" in arguments else arguments
        self.resumable = False
        self.exit_code = 0
        self._json = "--json" in options
        self._debug = "--debug" in options
        self._raised: weakref.ref[_Terminated] | None = None
        self._again: threading.Timer | None = None
        self._ctrl_c = False
        self._warned: set[str] = set()
        self._catch_warnings: AbstractContextManager[None] = warnings.catch_warnings()

    def __enter__(self) -> Boundary:
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, io.TextIOWrapper):  # what its encoding does not know is written as an escape
                stream.reconfigure(errors="backslashreplace")
        self._catch_warnings.__enter__()
        warnings.simplefilter("default")
        warnings.showwarning = self._show_warning
        if not self._debug:  # such as that there is no home folder to keep its fonts in
            logging.getLogger("matplotlib").setLevel(logging.ERROR)
        self._before = _handle(signal.SIGTERM, self._terminate)
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # else a shell has Ctrl-C ignored
            _handle(signal.SIGINT, self._interrupt)
        self._unraisable, sys.unraisablehook = sys.unraisablehook, self._show_unraisable
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool:
        if error is not None:
            self.exit_code = self._report(error)
        elif self.exit_code == EXIT_INTERRUPTED:  # Typer gives this code for Ctrl-C
            self._interrupted()
        self._leave_signals()
        self._catch_warnings.__exit__(None, None, None)
        flush(sys.stdout)
        flush(sys.stderr)
        return True

    def _report(self, error: BaseException) -> int:
        """Say what went wrong and give its exit code."""
        if self._raised is not None:  # whatever became of the exception on its way through a library
            self._stopped("Terminated", "ended by SIGTERM")
            return EXIT_TERMINATED
        if isinstance(error, SystemError) and isinstance(error.__cause__, KeyboardInterrupt | SystemExit):
            error = error.__cause__  # a signal met compiled code that returned as if nothing had happened
        if isinstance(error, SystemExit):
            return error.code if isinstance(error.code, int) else EXIT_BUG if error.code else 0
        # Modules of C that are being imported make an ImportError of it, others anything else.
        if isinstance(error, KeyboardInterrupt) or (self._ctrl_c and not isinstance(error, FieldkitError)):
            return self._interrupted()
        if self._debug:
            import traceback

            traceback.print_exception(error)
        if isinstance(error, FieldkitError):
            told: list[str] = []
            found = [finding_entry(finding) for finding in error.findings]
            if error.findings and not isinstance(error, MissionError):  # whose message they are
                from fieldkit.results.finding import finding_lines

                told, found = finding_lines(error.findings), [finding.stored() for finding in error.findings]
            self._tell(type(error).__name__, error.message, str(error.path or "") or None, error.remedy, found, told)
            return error.exit_code
        if isinstance(error, MemoryError):
            remedy = "Close other programs, or choose a lower --fidelity."
            self._tell("MemoryError", "not enough memory", None, remedy)
            return EXIT_BUG
        if _is_typers(error):
            context = getattr(error, "ctx", None)
            name = "fieldkit" if context is None else context.command_path
            if sentence := _sentence(error):  # none where help has been shown instead
                self._tell("UsageError", sentence, None, f"'{name} --help' explains the command.")
            return int(getattr(error, "exit_code", EXIT_BUG))
        if any(words in str(error) for words in _NO_TEXT):
            remedy = "Rename it (a file from another system may have another encoding), or set LANG=C.UTF-8."
            self._tell("UsageError", "a name of a file or folder is not text in this terminal", None, remedy)
            return UsageError.exit_code
        message = f"this is a bug in fieldkit: {type(error).__name__}: {error}"
        self._tell(type(error).__name__, message, None, "Run it again with --debug and report what that shows.")
        return EXIT_BUG

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        self._ctrl_c = True
        signal.default_int_handler(number, frame)

    def _terminate(self, number: int, frame: FrameType | None) -> None:
        """Raise, so that temporary folders are removed on the way out; again, where that came to nothing.

        Python drops what is raised within its own callbacks (of weak references, say, while it imports).
        """
        self._again = threading.Timer(_AGAIN_S, os.kill, (os.getpid(), signal.SIGTERM))
        self._again.daemon = True
        self._again.start()
        if self._raised is None or self._raised() is None:  # else it is on its way
            raise self._termination()

    def _termination(self) -> _Terminated:
        error = _Terminated(EXIT_TERMINATED)
        self._raised = weakref.ref(error)
        return error

    def _leave_signals(self) -> None:
        if self._again is not None:
            self._again.cancel()
            self._again.join()
        _handle(signal.SIGTERM, self._before or signal.SIG_DFL)
        if signal.getsignal(signal.SIGINT) == self._interrupt:
            _handle(signal.SIGINT, signal.default_int_handler)
        sys.unraisablehook = self._unraisable

    def _show_unraisable(self, dropped: sys.UnraisableHookArgs) -> None:
        if not isinstance(dropped.exc_value, _Terminated):
            self._unraisable(dropped)

    def _interrupted(self) -> int:
        self._stopped("Interrupted", "interrupted")
        return EXIT_INTERRUPTED

    def _stopped(self, kind: str, message: str) -> None:
        remedy = "The same command with --resume goes on from here." if self.resumable else ""
        self._tell(kind, message, None, remedy)

    def _tell(
        self,
        kind: str,
        message: str,
        path: str | None,
        remedy: str,
        findings: Sequence[dict[str, Any]] = (),
        told: Sequence[str] = (),
    ) -> None:
        where = f"{path}: " if path else ""
        say("\n  ".join([f"Error: {where}{message}", *filter(None, (remedy, *told))]))
        if self._json:
            more = {"findings": findings} if findings else {}
            emit_json({"error": {"type": kind, "message": message, "path": path, "remedy": remedy, **more}})

    def _show_warning(
        self,
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: TextIO | None = None,
        line: str | None = None,
    ) -> None:
        # fieldkit's own warnings are written for people; those of other libraries are for their authors.
        if category.__module__.startswith("fieldkit."):
            # Python tells a warning once per line of code that gave it; several stages may meet the same full disk.
            if str(message) not in self._warned:
                self._warned.add(str(message))
                say(f"Warning: {message}")
        elif self._debug:
            say(warnings.formatwarning(message, category, filename, lineno, line).rstrip())


def finding_entry(finding: Any) -> dict[str, Any]:
    """Something about a plan or a mission on a plot, as JSON has it: numbers as people count."""
    numbers = ((key, getattr(finding, key)) for key in ("station", "photograph"))
    return {
        "plot": finding.subject or None,
        "item": finding.item,
        **{key: None if number is None else number + 1 for key, number in numbers},
        **{key: getattr(finding, key) for key in ("code", "severity", "message", "remedy")},
    }


def emit_json(value: Any) -> None:
    """Print one JSON object on stdout. Numbers that JSON does not know become null."""
    import json

    answer(json.dumps(_plain(value), indent=2, allow_nan=False))


def say(text: str) -> None:
    """Print a remark for people, on stderr."""
    _print(text, sys.stderr)


def answer(text: str) -> None:
    """Print a line of a command's answer, on stdout."""
    _print(text, sys.stdout)


def _print(text: str, stream: TextIO) -> None:
    with suppress(BrokenPipeError):
        stream.write(text + "\n")
    flush(stream)


def flush(stream: TextIO) -> None:
    """Flush; a reader that has gone (``| head``) is no error, the result is in its folder."""
    try:
        stream.flush()
    except BrokenPipeError:
        with Path(os.devnull).open("wb") as nowhere:
            os.dup2(nowhere.fileno(), stream.fileno())


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | Iterator):
        return [_plain(item) for item in value]
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if hasattr(value, "tolist"):  # NumPy's scalars and arrays
        return _plain(value.tolist())
    if isinstance(value, float) and (value != value or value in (float("inf"), float("-inf"))):
        return None
    return value


def _is_typers(error: BaseException) -> bool:
    typer = sys.modules.get("typer")
    return typer is not None and isinstance(error, typer.TyperException | typer.Abort)


def _sentence(error: BaseException) -> str:
    message: str = error.format_message() if hasattr(error, "format_message") else "aborted"
    message = message.replace("Value error, ", "")  # pydantic's prefix
    return message[:1].lower() + message[1:].rstrip(".")


def _handle(number: signal.Signals, handler: Any) -> Any:
    try:
        return signal.signal(number, handler)
    except ValueError:  # not the main thread
        return None
