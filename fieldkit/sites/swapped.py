"""Plan and site given in each other's place."""

from __future__ import annotations

from pathlib import Path

from fieldkit.errors import UsageError
from fieldkit.regular_files import open_regular


def check_order(plan: Path, site: Path) -> None:
    """Refuse a plan and a site that are swapped, before reading one as the other says that it is broken.

    Raises:
        UsageError: what is given as the site is JSON or a folder, and what is given as the plan is neither.
    """
    if _may_be_plan(site) and not _may_be_plan(plan):
        raise UsageError(
            f"plan and site are swapped: {site} is no site file, and {plan} no plan",
            remedy=f"Give {site} as the plan and {plan} as --site.",
        )


def _may_be_plan(path: Path) -> bool:
    """Whether it is JSON or a folder; what cannot be read may be anything, and counts as what it is meant to be."""
    if path.is_dir():
        return True
    try:
        with open_regular(path) as file:
            return file.read(64).lstrip().startswith(b"{")
    except (OSError, ValueError):
        return path.suffix.lower() == ".json"
