"""Finding and reading the results of a folder."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

from fieldkit.campaign import read_campaign
from fieldkit.errors import FieldkitError, MetadataError, StorageError
from fieldkit.planning.run.folder import LOG_FILE, SETTINGS_FILE, read_log, read_settings, searched
from fieldkit.planning.run.outcome import OUTCOME_FILE, read_outcome
from fieldkit.regular_files import open_regular
from fieldkit.report.sections.loaded_results import (
    CampaignResult,
    ComparisonResult,
    EvaluationResult,
    MissionResult,
    PlanResult,
    ReferenceResult,
    Results,
    Unreadable,
)
from fieldkit.report.sections.plausible import check_plausible
from fieldkit.results.comparison import COMPARE_FILE, load_comparison
from fieldkit.results.demo import DEMO_FILE, DemoReport, load_demo
from fieldkit.results.mission import MissionFlight, MissionRecord
from fieldkit.results.mission_file import load_mission, records_in
from fieldkit.results.plan_file import PLAN_FILE, load_plan
from fieldkit.results.report_files import (
    EVALUATION_FILE,
    REFERENCE_FILE,
    file_sha256,
    load_evaluation_report,
    load_reference_report,
)
from fieldkit.results.visit import CAMPAIGN_FILE

DEPTH = 2
"""Levels below the folder that are searched."""

_REMEDY = (
    "Give a folder that a command of fieldkit wrote (reference, plan, export-mission, evaluate, compare, campaign, "
    "demo), or one that holds such folders."
)
_MOST_FOLDERS = 5000
_RESULT_FILES = (REFERENCE_FILE, EVALUATION_FILE, PLAN_FILE, SETTINGS_FILE, CAMPAIGN_FILE, COMPARE_FILE)
_EARLIER = "was exported by an earlier version of fieldkit, which wrote no mission.json"
_MOST_MISSIONS = 100
_ROUTE_BEGINS = b'"kind": "home"'  # the first feature of a route as GeoJSON
_Result = TypeVar("_Result")


def read_results(path: Path) -> Results:
    """Read all results of fieldkit in a folder or up to two levels below.

    Damaged results are listed, if there are others to show.

    Args:
        path: the folder, or a file of a result (reference.json …, mission.json, a mission).

    Raises:
        MetadataError: there is no result of fieldkit, or all are damaged.
        StorageError: the folder cannot be read.
    """
    path = Path(os.path.abspath(Path(path).expanduser()))  # noqa: PTH100 - links stay as they were given
    if not os.path.lexists(path):
        raise MetadataError("there is no such folder", path=path, remedy=_REMEDY)
    reader = _Reader(path if path.is_dir() else path.parent)
    if path.is_dir():
        for folder in _folders(path):
            reader.read_folder(folder)
    elif path.name in _RESULT_FILES:
        reader.read_folder(path.parent, only=path.name)
    else:
        reader.read_missions(path.parent, only=path.name)
    results = reader.results()
    if not results.count:
        if reader.first_error is not None:
            raise reader.first_error
        raise MetadataError("holds no result of fieldkit", path=path, remedy=_REMEDY)
    return results


def _folders(root: Path) -> Iterator[Path]:
    """The folder and those below it, by level and name, without the folders within campaigns."""
    level, seen = [root], 0
    for depth in range(DEPTH + 1):
        below: list[Path] = []
        for folder in level:
            seen += 1
            if seen > _MOST_FOLDERS:
                return
            yield folder
            if depth < DEPTH and not (folder / CAMPAIGN_FILE).is_file():
                below += _subfolders(folder)
        level = below


def _is_route(file: Path) -> bool:
    """Whether a GeoJSON file is the route of a mission."""
    try:
        with open_regular(file) as opened:
            return _ROUTE_BEGINS in opened.read(4096)
    except OSError:
        return False


def _subfolders(folder: Path) -> list[Path]:
    try:
        with os.scandir(folder) as entries:
            names = sorted(e.name for e in entries if not e.name.startswith(".") and e.is_dir(follow_symlinks=False))
    except OSError as error:
        raise StorageError(f"cannot be read: {error.strerror}", path=folder, remedy="Check its permissions.") from error
    return [folder / name for name in names]


class _Reader:
    """Gathers results, and notes the damaged ones."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.found: list[Any] = []
        self.unreadable: list[Unreadable] = []
        self.earlier: list[str] = []
        self.first_error: FieldkitError | None = None

    def results(self) -> Results:
        """The gathered results."""

        def of(kind: type[_Result]) -> tuple[_Result, ...]:
            return tuple(result for result in self.found if isinstance(result, kind))

        return Results(
            self.root, of(ReferenceResult), of(PlanResult), of(MissionResult), of(EvaluationResult), of(CampaignResult),
            tuple(self.unreadable), tuple(self.earlier), of(DemoReport), of(ComparisonResult),
        )  # fmt: skip

    def read_folder(self, folder: Path, only: str = "") -> None:
        """Read the folder itself as a result."""
        readers: list[tuple[str, Callable[[Path], Any]]] = [
            (REFERENCE_FILE, self._reference),
            (EVALUATION_FILE, self._evaluation),
            (CAMPAIGN_FILE, self._campaign),
            (COMPARE_FILE, self._comparison),
            (DEMO_FILE, load_demo),
        ]
        for file, read in readers:
            if (folder / file).is_file() and only in ("", file):
                self._try(folder / file, lambda read=read: read(folder))  # type: ignore[misc]
        held = [name for name in (PLAN_FILE, SETTINGS_FILE) if (folder / name).is_file()]
        # A campaign's plan is shown with the campaign.
        if held and only in ("", *held) and not (folder / CAMPAIGN_FILE).is_file():
            self._try(folder / held[0], lambda: self._plan(folder))
        if not only:
            self.read_missions(folder)

    def read_missions(self, folder: Path, only: str = "") -> None:
        """Read the flights of a folder's missions, or those of a given file."""
        described: set[str] = set()
        damaged = len(self.unreadable)
        for file in records_in(folder)[:_MOST_MISSIONS]:

            def read(file: Path = file) -> list[MissionResult]:
                record = load_mission(file)
                check_plausible(record.model_dump(), file)
                names = {file.name, *(entry.name for entry in record.files)}
                described.update(names)
                if only and only not in names:
                    return []
                results = [self._flight(file, record, flight) for flight in record.flights]
                return [result for result in results if result.flight.file == only] or results

            self._try(file, read)
        if len(self.unreadable) > damaged:
            return  # a route may belong to a damaged mission
        for route in sorted(folder.glob("*.geojson"))[:_MOST_MISSIONS]:
            wanted = not only or Path(only).stem == route.stem
            if wanted and route.name not in described and _is_route(route):
                self.earlier.append(self._name(route))
                self.first_error = self.first_error or MetadataError(
                    _EARLIER, path=route, remedy="Export it again with `fieldkit export-mission`."
                )

    def _flight(self, file: Path, record: MissionRecord, flight: MissionFlight) -> MissionResult:
        entry = next(entry for entry in record.files if entry.name == flight.file)
        beside = file.parent / flight.file
        there = beside.is_file()
        changed = there and file_sha256(beside) != entry.sha256
        return MissionResult(
            file, self._name(file), flight.file if there else "", changed, record, flight, file_sha256(file)
        )  # fmt: skip

    def _try(self, file: Path, read: Callable[[], Any]) -> None:
        try:
            result = read()
        except FieldkitError as error:
            self.first_error = self.first_error or error
            name = self._name(error.path if error.path is not None else file)
            self.unreadable.append(Unreadable(name, error.message, error.remedy))
            return
        except OSError as error:
            problem = StorageError(f"cannot be read: {error.strerror}", path=file, remedy="Check its permissions.")
            self.first_error = self.first_error or problem
            self.unreadable.append(Unreadable(self._name(file), problem.message, problem.remedy))
            return
        self.found += result if isinstance(result, list) else [result]

    def _name(self, path: Path) -> str:
        if path == self.root or not path.is_relative_to(self.root):
            return path.name
        return path.relative_to(self.root).as_posix()

    def _reference(self, folder: Path) -> ReferenceResult:
        report = load_reference_report(folder)
        check_plausible(report.model_dump(), folder / REFERENCE_FILE)
        return ReferenceResult(folder, self._name(folder), report, file_sha256(folder / REFERENCE_FILE))

    def _evaluation(self, folder: Path) -> EvaluationResult:
        report = load_evaluation_report(folder)
        check_plausible(report.model_dump(), folder / EVALUATION_FILE)
        return EvaluationResult(folder, self._name(folder), report, file_sha256(folder / EVALUATION_FILE))

    def _comparison(self, folder: Path) -> ComparisonResult:
        report = load_comparison(folder)
        check_plausible(report.model_dump(), folder / COMPARE_FILE)
        return ComparisonResult(folder, self._name(folder), report, file_sha256(folder / COMPARE_FILE))

    def _campaign(self, folder: Path) -> CampaignResult:
        campaign = read_campaign(folder)
        check_plausible([visit.row() for visit in campaign.visits], folder / CAMPAIGN_FILE)
        return CampaignResult(folder, self._name(folder), campaign, file_sha256(folder / CAMPAIGN_FILE))

    def _plan(self, folder: Path) -> PlanResult:
        file = folder / PLAN_FILE
        plan = load_plan(file) if file.is_file() else None
        if plan is not None:
            check_plausible(plan.model_dump(), file)
        sha256 = file_sha256(file) if plan is not None else ""
        if not (folder / SETTINGS_FILE).is_file():
            return PlanResult(folder, self._name(folder), plan, sha256)
        settings = read_settings(folder)
        check_plausible(settings.model_dump(), folder / SETTINGS_FILE)
        entries = read_log(folder) if (folder / LOG_FILE).is_file() else []
        check_plausible([entry.model_dump() for entry in entries], folder / LOG_FILE)
        outcome = read_outcome(folder) if (folder / OUTCOME_FILE).is_file() else None
        if outcome is not None:
            check_plausible(outcome.model_dump(), folder / OUTCOME_FILE)
        return PlanResult(
            folder, self._name(folder), plan, sha256, settings, tuple(searched(entries)),
            tuple(entry for entry in entries if entry.stage == "confirmation"),
            outcome,
        )  # fmt: skip
