"""Plots like a recorded one: its plants turned in front of the recorded cameras, with only a share of their matches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fieldkit.geometry import Similarity
from fieldkit.geometry.pose import rotation_from_vector
from fieldkit.planning.objective.objective import Objective, ObjectiveSettings
from fieldkit.planning.objective.recorded import RecordedSource, Rehearsal
from fieldkit.planning.space.plots import Plot

LEAST_KEPT = 0.3
"""Least share of matches kept: the recorded rigs' matches differ by up to three times."""
_STREAM, _GOLDEN = 53, (5**0.5 - 1) / 2
_ALL_ROUND = 1.5
"""Largest mean distance of turned views from their recorded ones, in spacings of the recorded views."""


@dataclass(frozen=True, eq=False)
class RecordedKind:
    """Plots of a recorded plot's kind, by number; 0 is the plot as it was recorded.

    Turning the plants is the same as turning the cameras, which have photographs if the views go all round. Else plots
    differ only in the share of matches.
    """

    source: RecordedSource
    """The recorded photographs."""
    seed: int

    def rehearsal(self, number: int) -> Rehearsal:
        """The changes of a plot."""
        if not number:
            return Rehearsal()
        turn_deg = float(np.random.default_rng([self.seed, _STREAM, number]).uniform(0.0, 360.0))
        # Spread evenly over the range, so that any few plots in a row have high shares and low ones.
        start = float(np.random.default_rng([self.seed, _STREAM]).random())
        kept = LEAST_KEPT + (1.0 - LEAST_KEPT) * ((start + number * _GOLDEN) % 1.0)
        return Rehearsal(turn_deg if self._all_round(turn_deg) else 0.0, kept, number)

    def plot(self, number: int, matches: NDArray[np.float64] | None) -> Plot:
        """The plot as planning knows it.

        Args:
            matches: (m, m) between the recorded views on the plot as recorded.
        """
        rehearsal, cloud = self.rehearsal(number), self.source.cloud
        middle = self.source.middle
        turn = rotation_from_vector(np.array([0.0, 0.0, np.radians(rehearsal.turn_deg)]))
        turned = cloud.transformed(Similarity(1.0, turn, middle - turn @ middle))
        if matches is not None:
            index = self.source.project(self.source.cameras().turned(middle, -rehearsal.turn_deg))
            matches = rehearsal.kept * matches[np.ix_(index, index)]
        return Plot(turned, np.zeros((0, 3)), matches)

    def _all_round(self, turn_deg: float) -> bool:
        cameras = self.source.cameras()
        turned = cameras.turned(self.source.middle, -turn_deg)
        nearest = cameras.select(self.source.project(turned))
        apart = np.linalg.norm(cameras.positions[:, None] - cameras.positions[None], axis=2)
        np.fill_diagonal(apart, np.inf)
        away = np.linalg.norm(nearest.positions - turned.positions, axis=1)
        return bool(away.mean() <= _ALL_ROUND * np.median(apart.min(axis=1)))


class RecordedPlots:
    """The objectives of plots of a recorded plot's kind; see `executor.Evaluator`."""

    def __init__(self, kind: RecordedKind, settings: ObjectiveSettings, *, seed: int = 0) -> None:
        self.kind, self.settings, self.seed = kind, settings, seed

    def prepare(self) -> None:
        """Do the one-off work of the first evaluation now."""
        self.kind.source.prepare()

    def on(self, plot: int) -> Objective:
        """The plot's objective."""
        source = self.kind.source.rehearsing(self.kind.rehearsal(plot))
        return Objective(source, self.settings, seed=self.seed)

    def close(self) -> None:
        """Nothing to free."""
