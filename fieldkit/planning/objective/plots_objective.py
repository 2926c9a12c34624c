"""The objectives of several plots of a kind, each built when it is first photographed."""

from __future__ import annotations

import pickle
import shutil
import tempfile
import weakref
from collections import OrderedDict
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from fieldkit.files import lock, write_atomic
from fieldkit.planning.objective.objective import Objective, ObjectiveSettings
from fieldkit.planning.objective.simulated import Proxy, SimulatedSource
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.scene import Scene
from fieldkit.sites.fitted import Stretch

_OPEN = 2
"""Number of plots that a process keeps ready to render; another renderer takes a second to start."""


class PlotsObjective:
    """Objectives by the plots' numbers; see `executor.Evaluator`.

    A plot's scene takes 17 CPU s to build. The first process that needs it shares it with the machine's other processes
    in a temporary folder, which is removed with this object.

    Args:
        build: makes a plot's proxy; picklable.
        source: makes the source of photographs from a plot's proxy; picklable.
        stretches: by plots' numbers, for those that cameras are fitted to.
    """

    def __init__(
        self, build: Callable[[int], Proxy], source: Callable[[Proxy], SimulatedSource],
        settings: ObjectiveSettings, *, seed: int = 0, stretches: Mapping[int, Stretch] | None = None,
    ) -> None:  # fmt: skip
        self._build, self._source, self.settings, self.seed = build, source, settings, seed
        self._stretches = stretches or {}
        self._shared = Path(tempfile.mkdtemp(prefix="fieldkit-plots-"))
        weakref.finalize(self, shutil.rmtree, self._shared, ignore_errors=True)
        self._open: OrderedDict[int, Objective] = OrderedDict()

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_open": OrderedDict()}

    def prepare(self) -> None:
        """Raises RenderingError: this machine cannot render."""
        Renderer(Scene(())).close()

    def on(self, plot: int) -> Objective:
        """The plot's objective. Raises SceneError."""
        if plot not in self._open:
            self._open[plot] = Objective(
                self._source(self._proxy(plot)), self.settings, seed=self.seed, stretch=self._stretches.get(plot)
            )
            if len(self._open) > _OPEN:
                self._open.popitem(last=False)[1].close()
        self._open.move_to_end(plot)
        return self._open[plot]

    def close(self) -> None:
        """Free the renderers."""
        for objective in self._open.values():
            objective.close()
        self._open.clear()

    def _proxy(self, plot: int) -> Proxy:
        if not self._shared.is_dir():  # on another machine
            return self._build(plot)
        file = self._shared / f"{plot}.pickle"
        with (self._shared / f"{plot}.lock").open("wb") as held:
            with suppress(OSError):  # without locks it is built twice
                lock(held.fileno(), wait=True)  # the second process waits for the first one's scene
            if not file.is_file():
                write_atomic(file, pickle.dumps(self._build(plot), pickle.HIGHEST_PROTOCOL))
            proxy: Proxy = pickle.loads(file.read_bytes())
        return proxy
