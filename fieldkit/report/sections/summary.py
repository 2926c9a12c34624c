"""The summary in words, by rules from the figures: what was done, how well, and what to do about problems.

Sentences state only what the figures say. Nothing is called good without a measure, and advice needs a figure.
"""

from __future__ import annotations

from fieldkit.figures.content import Statement
from fieldkit.report.sections.comparison import comparison_statements
from fieldkit.report.sections.loaded_results import Results
from fieldkit.report.sections.summary_campaign import campaign_statements
from fieldkit.report.sections.summary_captures import evaluation_statements, reference_statements
from fieldkit.report.sections.summary_plan import mission_statement, plan_statements


def summarise(results: Results) -> tuple[Statement, ...]:
    """The statements of a report, in the order of the page."""
    statements: list[Statement] = []
    for reference in results.references:
        statements += reference_statements(reference)
    for plan in results.plans:
        statements += plan_statements(plan)
    for mission in results.missions:
        statements.append(mission_statement(mission))
    for evaluation in results.evaluations:
        # The demo's plots are methods: their range says nothing, and its own table compares them.
        statements += evaluation_statements(evaluation, spread=not results.demos)
    for comparison in results.comparisons:
        statements += comparison_statements(comparison)
    for campaign in results.campaigns:
        statements += campaign_statements(campaign)
    statements += [
        Statement("problem", f"{each.name} is damaged and not shown: {each.message}.", each.remedy)
        for each in results.unreadable
    ]
    statements += [
        Statement(
            "note",
            f"{name} was exported by an earlier version of fieldkit, which wrote no mission.json: its way is not "
            "shown, only what the plan says.",
            "To see it, export the mission again.",
        )
        for name in results.earlier
    ]
    return tuple(statements)
