"""A campaign of many plots and dates with stand-in results, shown, exported and reported: docs/reliability.md."""

from __future__ import annotations

import argparse
import hashlib
import os
import subprocess
import sys
import tempfile
from datetime import date, timedelta
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "sim")]
from fieldkit.campaign.reading import stage_versions, visit_place  # noqa: E402
from fieldkit.results.traits import TraitsEntry  # noqa: E402
from fieldkit.results.visit import Visit, save_visit  # noqa: E402
from fieldkit.version import __version__  # noqa: E402
from tests.campaign.examples import campaign_folder, field  # noqa: E402

PHOTOGRAPHS = 13
COMMANDS = {
    "campaign show": ("campaign", "show", "season"),
    "campaign show --json": ("campaign", "show", "season", "--json"),
    **{f"campaign export, {end}": ("campaign", "export", "season", "-o", f"t{end}") for end in (".csv", ".geojson")},
    "campaign export, .gpkg": ("campaign", "export", "season", "-o", "t.gpkg"),
    "report": ("report", "season", "-o", "report.html"),
}


def make(folder: Path, plots: int, dates: int, seed: int = 0) -> None:
    """A campaign of plots in rows of 40, each visited every third day; one visit in fifty failed."""
    rng = np.random.default_rng(seed)
    sites = field(-(-plots // 40), 40)[:plots]
    season = campaign_folder(folder, sites)
    for plot in sites:
        height = rng.uniform(0.2, 0.6)
        for k in range(dates):
            day = (date(2026, 5, 20) + timedelta(days=3 * k)).isoformat()
            place, chamfer = visit_place(plot.name, day), float(rng.lognormal(-4.5, 0.3))
            height += float(rng.uniform(0.0, 0.1))
            shared = {
                "plot": plot.name,
                "date": day,
                "captures": f"card/{day}",
                "images": PHOTOGRAPHS,
                "fieldkit": __version__,
                "stages": stage_versions(),
                "inputs": f"{rng.integers(1 << 60):032x}",
                "photographs": {
                    hashlib.sha256(f"{place}{i}".encode()).hexdigest(): f"../card/{place}/IMG_{i:04}.jpg"
                    for i in range(PHOTOGRAPHS)
                },
            }
            if rng.random() < 0.02:
                save_visit(season / place, Visit(**shared, error="only 4 of 13 photographs fit together"))
                continue
            traits = TraitsEntry(
                height_m=height,
                height_error_m=0.03,
                height_error_below_m=0.04,
                cover_percent=20 * height,
                cover_error_percent=0.9,
                covered_area_m2=height / 2,
                covered_area_error_m2=0.03,
                canopy_volume_m3=height / 5,
                canopy_volume_error_m3=0.02,
                plot_area_m2=2.5,
                unknown=dict.fromkeys(("plants", "row_gaps"), "the plants cannot be told apart: they touch"),
            )
            figures = {
                "predicted_chamfer_m": chamfer,
                "predicted_low_m": 0.4 * chamfer,
                "predicted_high_m": 2 * chamfer,
            }
            right = int(rng.integers(10, 14))
            save_visit(
                season / place,
                Visit(**shared, **figures, registered=13, right=right, pose_rms_m=0.02, cpu_s=15.0, traits=traits),
            )


def main() -> int:
    """Make the campaign and measure the commands."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plots", type=int, default=1000)
    parser.add_argument("--dates", type=int, default=20)
    parser.add_argument("--folder", type=Path, help="keeps the campaign, and takes the one that is there")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="fieldkit-") as made:
        folder = given.folder or Path(made)
        if not (folder / "season").exists():
            folder.mkdir(parents=True, exist_ok=True)
            make(folder, given.plots, given.dates)
        for name, words in COMMANDS.items():
            more = () if words[1] == "show" else ("--overwrite",)
            command = [sys.executable, "-m", "fieldkit", *words, *more]
            process = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            _, status, usage = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
            cpu = usage.ru_utime + usage.ru_stime
            print(
                f"{name}: {cpu:.1f} CPU s, {usage.ru_maxrss / 1024:.0f} MB, exit code {process.returncode}", flush=True
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
