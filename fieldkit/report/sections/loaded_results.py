"""Results as read from their folders, for a report."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from fieldkit.campaign import Campaign
from fieldkit.planning.run.folder import LogEntry
from fieldkit.planning.run.outcome import Outcome
from fieldkit.planning.settings import SearchSettings
from fieldkit.results.comparison import ComparisonReport
from fieldkit.results.demo import DemoReport
from fieldkit.results.evaluation import EvaluationReport, ReferenceReport
from fieldkit.results.mission import MissionFlight, MissionRecord
from fieldkit.results.plan import Plan


@dataclass(frozen=True)
class ReferenceResult:
    """A reference.

    Attributes:
        folder: absolute.
        name: relative to the report's folder; its own name where it is that.
        report: reference.json.
        sha256: of reference.json.
    """

    folder: Path
    name: str
    report: ReferenceReport
    sha256: str


@dataclass(frozen=True)
class PlanResult:
    """A plan, alone or with its run.

    Attributes:
        folder, name: as `ReferenceResult` has them.
        plan: plan.json; None for an unfinished run.
        sha256: of plan.json, or empty.
        settings: search.json; None for a plan without a run.
        trials: the search's entries of evaluations.jsonl, by number.
        confirmations: its entries of finalists.
        outcome: outcome.json, or None.
    """

    folder: Path
    name: str
    plan: Plan | None
    sha256: str
    settings: SearchSettings | None = None
    trials: tuple[LogEntry, ...] = ()
    confirmations: tuple[LogEntry, ...] = ()
    outcome: Outcome | None = None


@dataclass(frozen=True)
class MissionResult:
    """A flight of a mission.

    Attributes:
        file: absolute path of mission.json.
        name: relative to the report's folder.
        mission_file: name of the vehicle's file; empty if it is not beside mission.json.
        changed: whether that file differs from the exported one.
        record: mission.json.
        flight: the flight within it.
        sha256: of mission.json.
    """

    file: Path
    name: str
    mission_file: str
    changed: bool
    record: MissionRecord
    flight: MissionFlight
    sha256: str


@dataclass(frozen=True)
class EvaluationResult:
    """An evaluation.

    Attributes:
        folder, name: as `ReferenceResult` has them.
        report: evaluation.json.
        sha256: of evaluation.json.
    """

    folder: Path
    name: str
    report: EvaluationReport
    sha256: str


@dataclass(frozen=True)
class CampaignResult:
    """A campaign.

    Attributes:
        folder, name: as `ReferenceResult` has them.
        campaign: its plots and the rows of its table.
        sha256: of campaign.toml.
    """

    folder: Path
    name: str
    campaign: Campaign
    sha256: str


@dataclass(frozen=True)
class ComparisonResult:
    """A comparison of evaluations.

    Attributes:
        folder, name: as `ReferenceResult` has them.
        report: compare.json.
        sha256: of compare.json.
    """

    folder: Path
    name: str
    report: ComparisonReport
    sha256: str


@dataclass(frozen=True)
class Unreadable:
    """A damaged result.

    Attributes:
        name: relative to the report's folder.
        message: what is wrong.
        remedy: what to do.
    """

    name: str
    message: str
    remedy: str


@dataclass(frozen=True)
class Results:
    """All results of a folder, each kind in the order of names.

    Attributes:
        root: absolute.
        references, plans, missions, evaluations, campaigns, comparisons: readable results.
        unreadable: damaged results.
        earlier: names of missions without a mission.json, from early versions of fieldkit.
        demos: comparisons of planned views with a circle; the evaluations beside each are theirs.
    """

    root: Path
    references: tuple[ReferenceResult, ...] = ()
    plans: tuple[PlanResult, ...] = ()
    missions: tuple[MissionResult, ...] = ()
    evaluations: tuple[EvaluationResult, ...] = ()
    campaigns: tuple[CampaignResult, ...] = ()
    unreadable: tuple[Unreadable, ...] = ()
    earlier: tuple[str, ...] = ()
    demos: tuple[DemoReport, ...] = ()
    comparisons: tuple[ComparisonResult, ...] = ()

    @property
    def count(self) -> int:
        """Number of results that can be shown."""
        kinds = (self.references, self.plans, self.missions, self.evaluations, self.campaigns, self.comparisons)
        return sum(len(kind) for kind in kinds)
