"""Patterns side by side: what apps fly, and what is planned, over blocks of trials that nobody planned on."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from types import MappingProxyType

import shapely

from benchmarks.result import Cell, ResultTable, StudyResult
from benchmarks.trials import SEEDS, block_named
from fieldkit.planning.patterns.block import LAYOUT, ROWS_DEG, Block
from fieldkit.planning.patterns.front import FrontPattern, PatternWorth, front_of, over
from fieldkit.planning.patterns.objective import PatternEvaluation, evaluate
from fieldkit.planning.patterns.plan import choose, shipped_patterns
from fieldkit.planning.patterns.space import PatternSpace
from fieldkit.planning.plan_settings import TrialSettings
from fieldkit.planning.run.flyable import flight_noise
from fieldkit.results.pattern import Look, Pattern
from fieldkit.runtime.progress import Progress
from fieldkit.scenes.renderer import Renderer
from fieldkit.vehicles.vehicle_file import load_vehicle
from fieldkit.vocabulary import Stage

_VEHICLE = load_vehicle("ardupilot-pitch")
_FIELD = shapely.box(0.0, 0.0, 19.0, 15.0)
"""Forty plots of 4 × 1.5 m with alleys of 1 m, metres."""
_PLOTS = 40
_DOWN, _WAYS = Look(0.0, -90.0), tuple(Look(heading, -60.0) for heading in (0.0, 90.0, 180.0, 270.0))
_GRIDS: Mapping[str, Pattern] = MappingProxyType(
    {
        "down and four ways, 8 m": Pattern((_DOWN, *_WAYS), 8.0, 1.88, 3.35, 0.0),
        "straight down, 8 m": Pattern((_DOWN,), 8.0, 1.26, 1.68),
        "straight down, 12 m": Pattern((_DOWN,), 12.0, 1.88, 2.51),
    }
)
"""What apps fly: overlaps of 80 %, with oblique ways of 70 and 60 %."""
_SHARE = 0.4
"""Of the first one's minutes, in which a pattern is planned."""
_TUNING_SEED = 11
"""Of the blocks that patterns were chosen on."""
_NOTE = (
    "Middle plot of 3 × 7, 10 mm of wind and wash, positions to 2 cm, angles to 1°, 12 megapixels behind a narrow lens "
    "(ardupilot-pitch). Errors are measured less true, cover in percent of the plot, volume in percent of the truth."
)


def run_patterns(stages: Sequence[str], *, work: Path, progress: Progress) -> StudyResult:
    """Measure patterns on the test blocks of stages, each once.

    Args:
        stages: such as V10; tuning-V10 for the block that patterns were chosen on; V10/7 for the shipped pattern of
            that number, from 0, alone. Empty takes all.
        work: keeps what was measured for later runs.
    """
    rows, figures = [], {}
    for asked in stages or SEEDS:
        named, stage, seed, number = block_named(asked, _TUNING_SEED)
        patterns = _patterns(stage, number)
        files = {name: work / f"{named}-{name.replace(' ', '-')}.json" for name in patterns}
        if not all(file.is_file() for file in files.values()):
            block = Block.of(replace(LAYOUT, stage=stage, seed=seed))
            camera, noise = _VEHICLE.camera.without_distortion(), flight_noise(_VEHICLE)
            with Renderer(block.scene) as renderer, progress.stage(named, len(files)) as advance:
                for name, file in files.items():
                    if not file.is_file():
                        made = evaluate(patterns[name].worth.pattern, block, renderer, camera, noise, seed)
                        file.write_text(json.dumps(asdict(made)), "utf-8")
                    advance(1)
        for name, file in files.items():
            made = PatternEvaluation(**json.loads(file.read_text("utf-8")))
            rows.append(_row(f"{named}: {name}", patterns[name], made))
            figures[f"{named}: {name}"] = asdict(made)
    columns = (
        "Pattern",
        "minutes>",
        "photographs a plot>",
        "taken; right>",
        "within 20 mm>",
        "−r, mm>",
        "95 % of height, cm>",
        "99 %>",
        "cover>",
        "volume>",
    )
    table = ResultTable("Patterns", columns, tuple(rows))
    return StudyResult("patterns", "Patterns of passes over trials", tables=(table,), notes=(_NOTE,), figures=figures)


def _patterns(stage: Stage, number: str) -> dict[str, FrontPattern]:
    """Grids, and what `plan` chooses in a share of the slowest one's minutes; or the shipped one of a number."""
    shipped = shipped_patterns(stage, 0.0, _VEHICLE)
    space = PatternSpace(_VEHICLE, shipped.plants_m)

    def flown(worth: PatternWorth) -> FrontPattern:
        return over(worth, space, _FIELD, ROWS_DEG)

    if number:
        return {f"shipped {number}": flown(shipped.patterns[int(number)])}
    grids = {name: flown(PatternWorth(pattern=pattern, value_m=0.0)) for name, pattern in _GRIDS.items()}
    asked = TrialSettings(minutes=_SHARE * max(each.minutes for each in grids.values()))
    front = front_of(flown(worth) for worth in shipped.patterns if space.allows(worth.pattern))
    return {"planned": choose(front, asked, _VEHICLE), **grids}


def _row(name: str, flown: FrontPattern, made: PatternEvaluation) -> tuple[Cell, ...]:
    errors = made.errors or {}

    def cell(trait: str, factor: float) -> Cell:
        return f"{factor * errors[trait]:+.1f}" if trait in errors else "refused"

    return (
        name,
        f"{flown.minutes:.1f}",
        f"{flown.photographs / _PLOTS:.1f}",
        f"{made.photographs}; {made.right}",
        f"{100.0 * made.within:.0f} %",
        f"{1000.0 * made.value_m:.1f}",
        cell("height_p95_m", 100.0),
        cell("height_p99_m", 100.0),
        cell("cover_percent", 1.0),
        cell("canopy_volume_m3", 100.0),
    )
