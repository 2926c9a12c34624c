"""CPU time of a run."""

from __future__ import annotations

import os
import time


def processor_seconds() -> float:
    """CPU time (user + system) of this process and, where the system keeps it, of its finished children, seconds."""
    spent = os.times()
    return time.process_time() + spent.children_user + spent.children_system
