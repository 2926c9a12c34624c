"""Hypothesis without a time limit per example: the first call of a numba function compiles it."""

from __future__ import annotations

from hypothesis import settings

settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")
