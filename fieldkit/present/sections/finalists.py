"""The finalists of a search, for the report and for the terminal."""

from __future__ import annotations

from fieldkit.planning.run.outcome import Outcome
from fieldkit.present.content import Cell, Column, Table
from fieldkit.present.style import millimetres

_NOTE = (
    "Finalists are evaluated again with new random numbers: the lowest of many noisy values is partly luck. Compare "
    "values within a column only: confirmations may be at a finer quality than the search."
)


def finalist_table(outcome: Outcome) -> Table:
    """The best sets of a search, the plan first; trials have the numbers of evaluations.jsonl."""
    columns = [Column("trial"), Column("how it was proposed", short="from")]
    lengths = (
        ("expected_m", Column("expected, mm", True)),
        ("search_value_m", Column("in the search, mm", True, short="search, mm")),
        ("value_m", Column("confirmed, mm", True)),
        ("spread_m", Column("spread, mm", True, short="±, mm")),
        ("kind_m", Column("expected after all evaluations, mm", True, short="kind, mm")),
    )
    known = [(key, column) for key, column in lengths if any(getattr(f, key) is not None for f in outcome.finalists)]
    columns += [column for _, column in known]
    columns.append(Column("photographs used", short="used"))
    rows: list[tuple[Cell, ...]] = []
    for place, found in enumerate(outcome.finalists):
        values = [millimetres(getattr(found, key)) for key, _ in known]
        name = f"{found.number}{', the plan' if place == 0 else ''}"
        rows.append((name, found.origin, *values, ", ".join(map(str, found.right))))
    return Table("Finalists", tuple(columns), tuple(rows), _NOTE)
