"""Finding and reading the results of a folder, for a report."""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from pydantic_core import to_jsonable_python

from fieldkit.campaign.reading import read_campaign
from fieldkit.errors import FieldkitError, MetadataError, StorageError
from fieldkit.results.demo import DEMO_FILE, DemoReport, load_demo
from fieldkit.results.mission import MissionFlight, MissionRecord, load_mission, records_in
from fieldkit.results.plan import Plan
from fieldkit.results.plan_file import PLAN_FILE, SETTINGS_FILE, load_plan
from fieldkit.results.report_files import (
    EVALUATION_FILE,
    REFERENCE_FILE,
    file_sha256,
    load_evaluation_report,
    load_reference_report,
)
from fieldkit.results.visit import CAMPAIGN_FILE

if TYPE_CHECKING:
    from fieldkit.planning.run.folder import LogEntry
    from fieldkit.planning.run.outcome import Outcome
    from fieldkit.planning.settings import SearchSettings

LARGEST = 1e9
"""Largest measurement that is shown (metres, pixels, seconds, degrees): beyond it drawings overflow."""
LARGEST_COUNT = 2**64
"""Largest count that is shown."""

_REMEDY = (
    "Give a folder that a command of fieldkit wrote (reference, plan, export-mission, evaluate, campaign, "
    "demo), or one that holds such folders."
)
_MOST_MISSIONS = 100
"""Most missions of a folder."""

T = TypeVar("T")


@dataclass(frozen=True)
class PlanRun:
    """A plan, alone or with its run."""

    plan: Plan | None
    """None for an unfinished run."""
    settings: SearchSettings | None = None
    """None for a plan without a run."""
    trials: tuple[LogEntry, ...] = ()
    """Of the search, by number."""
    outcome: Outcome | None = None


@dataclass(frozen=True)
class FlownMission:
    """A flight of a mission."""

    record: MissionRecord
    flight: MissionFlight
    mission_file: str
    """Name of the vehicle's file; empty if it is not beside mission.json."""
    changed: bool
    """Whether that file differs from the exported one."""


@dataclass(frozen=True)
class Loaded(Generic[T]):
    """A result and where it lies."""

    file: Path
    """Absolute."""
    name: str
    """Of its folder, relative to the report's; its own name where it is that."""
    report: T
    """What the file says, or the run or campaign that it belongs to."""
    sha256: str

    @property
    def folder(self) -> Path:
        """Absolute."""
        return self.file.parent


@dataclass(frozen=True)
class Unreadable:
    """A damaged result."""

    name: str
    message: str
    remedy: str


@dataclass(frozen=True)
class Results:
    """All results of a folder, each kind in the order of names."""

    root: Path
    found: tuple[Loaded[Any], ...] = ()
    unreadable: tuple[Unreadable, ...] = ()

    def of(self, kind: type[T]) -> tuple[Loaded[T], ...]:
        """The results of a kind."""
        return tuple(each for each in self.found if isinstance(each.report, kind))

    def path(self, result: Loaded[Any]) -> str:
        """A result's folder as commands are given it, from where the report's folder lies."""
        return shlex.quote(os.path.relpath(result.folder, self.root.parent))


_READERS: Mapping[str, Callable[[Path], Any]] = {
    REFERENCE_FILE: load_reference_report,
    EVALUATION_FILE: load_evaluation_report,
    CAMPAIGN_FILE: read_campaign,
    DEMO_FILE: load_demo,
}
"""By the file that makes a folder such a result; plans and missions have readers of their own."""


def read_results(path: Path) -> Results:
    """Read all results of fieldkit in a folder or up to two levels below.

    Damaged results are listed, if there are others to show.
    """
    path = Path(os.path.abspath(Path(path).expanduser()))  # noqa: PTH100 - links stay as they were given
    if not path.is_dir():
        raise MetadataError("there is no such folder", path=path, remedy=_REMEDY)
    reader = _Reader(path)
    for folder in _folders(path):
        reader.read_folder(folder)
    if all(isinstance(each.report, DemoReport) for each in reader.found):
        if reader.first_error is not None:
            raise reader.first_error
        raise MetadataError("holds no result of fieldkit", path=path, remedy=_REMEDY)
    return Results(path, tuple(reader.found), tuple(reader.unreadable))


def check_plausible(values: Any, file: Path) -> None:
    """Refuse a file with numbers that would overflow in drawings; ``values`` are plain, as pydantic dumps them."""
    waiting: list[tuple[str, Any]] = [("", values)]
    while waiting:
        key, parts = waiting.pop()
        for name, value in parts.items() if isinstance(parts, dict) else enumerate(parts):
            if isinstance(value, dict | list | tuple):
                waiting.append((f"{key}{name}.", value))
            elif (isinstance(value, float) and not abs(value) <= LARGEST) or (  # NaN is not, either
                isinstance(value, int) and abs(value) > LARGEST_COUNT
            ):
                what = f"{f'{key}{name}'[:200]}: is a number that no measurement gives"
                raise MetadataError(what, path=file, remedy="Make the result again.")


def _folders(root: Path) -> list[Path]:
    """The folder and those up to two levels below, by level and name, without the folders within campaigns."""
    folders = [root, *sorted(root.glob("[!.]*/")), *sorted(root.glob("[!.]*/[!.]*/"))]
    campaigns = {folder for folder in folders if (folder / CAMPAIGN_FILE).is_file()}
    links = {folder for folder in folders[1:] if folder.is_symlink()}
    return [
        folder for folder in folders if folder not in links and not (campaigns | links).intersection(folder.parents)
    ]


class _Reader:
    """Gathers results, and notes the damaged ones."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.found: list[Loaded[Any]] = []
        self.unreadable: list[Unreadable] = []
        self.first_error: FieldkitError | None = None

    def read_folder(self, folder: Path) -> None:
        """Read the results of a folder and the flights of its missions."""
        for name in _READERS:
            if (folder / name).is_file():
                self._try(folder / name, lambda file: [_READERS[file.name](file.parent)])
        held = [name for name in (PLAN_FILE, SETTINGS_FILE) if (folder / name).is_file()]
        # A campaign's plan is shown with the campaign.
        if held and not (folder / CAMPAIGN_FILE).is_file():
            self._try(folder / held[0], lambda _: [_plan_run(folder)])
        for file in records_in(folder)[:_MOST_MISSIONS]:
            self._try(file, _flights)

    def _try(self, file: Path, read: Callable[[Path], list[Any]]) -> None:
        try:
            reports = read(file)
            for report in reports:
                check_plausible(to_jsonable_python(report), file)
            sha256 = file_sha256(file)
        except FieldkitError as error:
            self._damaged(error, file if error.path is None else Path(error.path))
        except OSError as error:
            remedy = "Check its permissions."
            self._damaged(StorageError(f"cannot be read: {error.strerror}", path=file, remedy=remedy), file)
        else:
            name = self._name(file.parent)
            self.found += [Loaded(file, name, report, sha256) for report in reports]

    def _damaged(self, error: FieldkitError, file: Path) -> None:
        self.first_error = self.first_error or error
        self.unreadable.append(Unreadable(self._name(file), error.message, error.remedy))

    def _name(self, path: Path) -> str:
        if path == self.root or not path.is_relative_to(self.root):
            return path.name
        return path.relative_to(self.root).as_posix()


def _plan_run(folder: Path) -> PlanRun:
    plan = load_plan(folder / PLAN_FILE, patterns=True) if (folder / PLAN_FILE).is_file() else None
    if not (folder / SETTINGS_FILE).is_file():
        return PlanRun(plan)
    from fieldkit.planning.run.folder import LOG_FILE, read_log, read_settings, searched
    from fieldkit.planning.run.outcome import OUTCOME_FILE, read_outcome

    entries = read_log(folder) if (folder / LOG_FILE).is_file() else []
    outcome = read_outcome(folder) if (folder / OUTCOME_FILE).is_file() else None
    return PlanRun(plan, read_settings(folder), tuple(searched(entries)), outcome)


def _flights(file: Path) -> list[FlownMission]:
    """The flights of a mission."""
    record = load_mission(file)
    sha256 = {entry.name: entry.sha256 for entry in record.files}
    flights = []
    for flight in record.flights:
        beside = file.parent / flight.file
        there = beside.is_file()
        changed = there and file_sha256(beside) != sha256[flight.file]
        flights.append(FlownMission(record, flight, flight.file if there else "", changed))
    return flights
