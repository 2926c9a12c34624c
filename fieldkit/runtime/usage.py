"""CPU time of a run."""

from __future__ import annotations

import resource


def processor_seconds() -> float:
    """CPU time (user + system) of this process and of its finished children, seconds."""
    spent = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in spent)
