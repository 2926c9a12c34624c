"""An objective that answers at once and breaks where its cameras tell it to."""

import os
import signal
import time
from pathlib import Path

import numpy as np

from fieldkit.errors import InputError, UsageError
from fieldkit.planning.objective.evaluation import Evaluation
from fieldkit.planning.objective.objective import Objective, ObjectiveSettings
from fieldkit.planning.space.cameras import Cameras
from fieldkit.vocabulary import SearchFidelity

SEGFAULT, HANG, GROW, RAISE, REFUSE, SLOW = (100.0 + k for k in range(6))


class Trap(Objective):
    """The first camera's x says what happens: an ordinary x gives the cameras' sum."""

    def __init__(self, folder: Path, *, unusable: bool = False, dies_at_start: bool = False) -> None:
        self.settings, self.seed, self.folder = ObjectiveSettings(), 0, folder
        self.unusable, self.dies_at_start = unusable, dies_at_start

    def prepare(self) -> None:
        if self.dies_at_start:
            os._exit(9)
        if self.unusable:
            raise InputError("nothing can be rendered here")
        (self.folder / f"worker-{os.getpid()}").touch()

    def close(self) -> None:
        pass

    def evaluate(
        self, cameras: Cameras, *, seed: int | None = None, fidelity: SearchFidelity | None = None
    ) -> Evaluation:
        what = float(cameras.positions[0, 0])
        with (self.folder / "attempts").open("a") as file:
            file.write(f"{what:g}\n")
        if what == SEGFAULT:
            os.kill(os.getpid(), signal.SIGSEGV)
        if what == HANG:
            time.sleep(600)
        if what == GROW:
            kept = []
            while True:
                kept.append(np.ones(8 << 20))  # 64 MiB
                time.sleep(0.02)
        if what == RAISE:
            raise RuntimeError("a bug")
        if what == REFUSE:
            raise UsageError("these cameras cannot be had")
        if what == SLOW:
            time.sleep(0.5)
        value = float(cameras.vector().sum()) + (seed or 0)
        return Evaluation(value_m=value)


def job_cameras(x: float) -> Cameras:
    return Cameras(np.array([[x, 0.0, 1.0], [0.0, 0.0, 1.0]]), np.zeros(2), np.zeros(2))
