"""The finalists of a search, for the report and for the terminal."""

from __future__ import annotations

from fieldkit.figures.content import Column, Table, tabulated
from fieldkit.figures.style import millimetres
from fieldkit.planning.run.outcome import Outcome

_NOTE = (
    "Finalists are evaluated again with new random numbers: the lowest of many noisy values is partly luck. Compare "
    "values within a column only: confirmations may be at a finer quality than the search."
)


def finalist_table(outcome: Outcome) -> Table:
    """The finalists of a search, the plan first; trials count from 1, the `number` of evaluations.jsonl from 0."""
    best = outcome.finalists[0].number if outcome.finalists else -1
    return tabulated("Finalists", [
        {
            "trial": f"{found.number + 1}{', the plan' * (found.number == best)}",
            Column("how it was proposed", short="from"): found.origin,
            Column("expected, mm", True): millimetres(found.expected_m),
            Column("in the search, mm", True, short="search, mm"): millimetres(found.search_value_m),
            Column("confirmed, mm", True): millimetres(found.value_m),
            Column("spread, mm", True, short="±, mm"): millimetres(found.spread_m),
            Column("expected after all evaluations, mm", True, short="kind, mm"): millimetres(found.kind_m),
            Column("photographs used", short="used"): ", ".join(map(str, found.right)),
        }
        for found in outcome.finalists
    ], _NOTE)  # fmt: skip
