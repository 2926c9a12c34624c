"""Finding and reading the results that a folder holds."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

from fieldkit.campaign import read_campaign
from fieldkit.errors import FieldkitError, MetadataError, StorageError
from fieldkit.planning.run.folder import LOG_FILE, SETTINGS_FILE, read_log, read_settings, searched
from fieldkit.planning.run.outcome import OUTCOME_FILE, read_outcome
from fieldkit.present.sections.loaded_results import (
    CampaignResult,
    EvaluationResult,
    MissionResult,
    PlanResult,
    ReferenceResult,
    Results,
    Unreadable,
)
from fieldkit.present.sections.plausible import check_plausible
from fieldkit.present.sections.route import read_route
from fieldkit.results.plan_file import PLAN_FILE, load_plan
from fieldkit.results.report_files import (
    EVALUATION_FILE,
    REFERENCE_FILE,
    file_sha256,
    load_evaluation_report,
    load_reference_report,
)

CAMPAIGN_FILE = "campaign.toml"
DEPTH = 2
"""So many levels below the folder are looked through."""

_REMEDY = (
    "Give a folder that a command of fieldkit wrote (reference, plan, export-mission, evaluate, campaign, demo), or "
    "one that holds such folders."
)
_MOST_FOLDERS = 5000
_RESULT_FILES = (REFERENCE_FILE, EVALUATION_FILE, PLAN_FILE, SETTINGS_FILE, CAMPAIGN_FILE)
_MISSION_SUFFIXES = (".plan", ".waypoints", ".kmz", ".csv", ".kml")
_Result = TypeVar("_Result")


def read_results(path: Path) -> Results:
    """Read everything of fieldkit's that a folder holds, itself or up to two levels below.

    What is damaged is told in the results, as long as there is something else to show.

    Args:
        path: the folder; or a file of a result (reference.json …, a mission or its route), which stands for its result.

    Raises:
        MetadataError: nothing of fieldkit's is there, or all of it is damaged.
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
    elif path.with_suffix(".geojson").is_file():
        reader.read_mission(path.with_suffix(".geojson"))
    results = reader.results()
    if not results.count:
        if reader.first_error is not None:
            raise reader.first_error
        raise MetadataError("holds no result of fieldkit", path=path, remedy=_REMEDY)
    return results


def _folders(root: Path) -> Iterator[Path]:
    """The folder and those below it, level by level, in the order of names. Campaigns' own folders are left to them."""
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


def _subfolders(folder: Path) -> list[Path]:
    try:
        with os.scandir(folder) as entries:
            names = sorted(e.name for e in entries if not e.name.startswith(".") and e.is_dir(follow_symlinks=False))
    except OSError as error:
        raise StorageError(f"cannot be read: {error.strerror}", path=folder, remedy="Check its permissions.") from error
    return [folder / name for name in names]


class _Reader:
    """Gathers results; what is damaged becomes a note."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.found: list[Any] = []
        self.unreadable: list[Unreadable] = []
        self.first_error: FieldkitError | None = None

    def results(self) -> Results:
        """What was gathered."""

        def of(kind: type[_Result]) -> tuple[_Result, ...]:
            return tuple(result for result in self.found if isinstance(result, kind))

        return Results(
            self.root, of(ReferenceResult), of(PlanResult), of(MissionResult), of(EvaluationResult), of(CampaignResult),
            tuple(self.unreadable),
        )  # fmt: skip

    def read_folder(self, folder: Path, only: str = "") -> None:
        """Whatever result the folder itself is."""
        readers: list[tuple[str, Callable[[Path], Any]]] = [
            (REFERENCE_FILE, self._reference),
            (EVALUATION_FILE, self._evaluation),
            (CAMPAIGN_FILE, self._campaign),
        ]
        for file, read in readers:
            if (folder / file).is_file() and only in ("", file):
                self._try(folder / file, lambda read=read: read(folder))  # type: ignore[misc]
        held = [name for name in (PLAN_FILE, SETTINGS_FILE) if (folder / name).is_file()]
        # A campaign's own plan is told of with the campaign.
        if held and only in ("", *held) and not (folder / CAMPAIGN_FILE).is_file():
            self._try(folder / held[0], lambda: self._plan(folder))
        if not only:
            for route in sorted(folder.glob("*.geojson"))[:100]:
                self.read_mission(route)

    def read_mission(self, file: Path) -> None:
        """A route, where the file is one."""

        def read() -> MissionResult | None:
            route = read_route(file)
            if route is None:
                return None
            beside = next((b.name for s in _MISSION_SUFFIXES if (b := file.with_suffix(s)).is_file()), "")
            return MissionResult(file, self._name(file), beside, route, file_sha256(file))

        self._try(file, read)

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
        if result is not None:
            self.found.append(result)

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

    def _campaign(self, folder: Path) -> CampaignResult:
        campaign = read_campaign(folder)
        check_plausible([asdict(visit) for visit in campaign.visits], folder / CAMPAIGN_FILE)
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
