"""Write sim/scenes (the paper's cases and test cases, the tuning scenes), the JSON schemas of scenes, plans, missions
and runs, and the tables of keys in sim/README.md.
"""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from fieldkit.documents.json_file import schema_text
from fieldkit.documents.toml_file import FORMAT
from fieldkit.geometry import Intrinsics
from fieldkit.planning.run.outcome import run_schemas
from fieldkit.results.report_files import SCHEMA_FILES, json_schema
from fieldkit.scenes.description import SceneDescription
from fieldkit.scenes.scene_file import write_scene
from fieldkit_sim.generator import new_scene, varied, without_plant

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "sim" / "scenes"
GUIDE = ROOT / "sim" / "README.md"
_MARK = "<!-- keys: written by scripts/make_scenes.py -->"


def scenes() -> dict[str, SceneDescription]:
    """Every scene by name."""
    found: dict[str, SceneDescription] = {}
    for name, plants, seed in (("case-1", 3, 101), ("case-2", 5, 102), ("case-3", 6, 103)):
        found[name] = new_scene(plants, seed, name=name, notes=f"BOSfM's {name.replace('-', ' ')}: {plants} plants.")
    for number, seed in ((1, 301), (2, 302), (3, 303)):
        name, base = f"test-case-{number}", f"case-{number}"
        found[name] = varied(found[base], seed, name=name, notes=f"{base} with its plants re-scaled and re-rotated.")
    for number, base, plant in ((4, "case-1", 2), (5, "case-3", 5)):
        name = f"test-case-{number}"
        found[name] = without_plant(found[base], plant, name=name, notes=f"{base} without its plant {plant}.")
    found |= tuning_scenes()
    found["demo"] = demo_scene()
    return found


def demo_scene() -> SceneDescription:
    """Three young plants in still air, on a soil a little coarser than the others': built and drawn in seconds."""
    scene = new_scene(
        3,
        401,
        spacing_m=0.24,
        stages=("V6", "V7"),
        soil="crumb",
        cover_per_m2=0.0,
        weeds_per_m2=0.0,
        name="demo",
        notes="Three young plants, drawn in seconds.",
    )
    soil = replace(scene.plot.soil, spacing_m=0.008)
    camera = Intrinsics.pinhole(1000, 750, 850.0)
    effects = replace(scene.camera_effects, grain=2.0, grain_px=1.0)  # what is left of it at half the size
    plot = replace(scene.plot, soil=soil)
    return replace(scene, plot=plot, camera=camera, camera_effects=effects, wind_m=0.0)


def tuning_scenes() -> dict[str, SceneDescription]:
    """What parameters are chosen on: other layouts, sizes, soils and suns than the cases'."""
    notes = "For choosing parameters. {}"
    scenes = {
        "tuning-1": new_scene(3, 201, soil="crumb", notes=notes.format("One row of 3.")),
        "tuning-2": new_scene(5, 202, layout="grid", spacing_m=0.30, notes=notes.format("5 on a wide grid.")),
        "tuning-3": new_scene(
            4,
            203,
            layout="random",
            spacing_m=0.35,
            neighbour_rows=1,
            notes=notes.format("4 at random between neighbour rows."),
        ),
        "tuning-4": new_scene(6, 204, spacing_m=0.18, stages=("V5", "V6"), notes=notes.format("6 young plants.")),
        "tuning-5": new_scene(
            2, 205, spacing_m=0.40, stages=("V12",), soil="crumb", notes=notes.format("2 large plants.")
        ),
        "tuning-6": new_scene(
            7,
            206,
            layout="random",
            soil="crusted",
            cover_per_m2=0.0,
            weeds_per_m2=0.0,
            notes=notes.format("7 at random on bare, crusted soil."),
        ),
    }
    bare = scenes["tuning-6"].plot
    soil = replace(bare.soil, stones=20, residues=5, contrast=0.3)
    scenes["tuning-6"] = replace(scenes["tuning-6"], plot=replace(bare, soil=soil))
    return {name: replace(scene, name=name) for name, scene in scenes.items()}


def scene_schema() -> str:
    """JSON Schema (2020-12) of a scene file, as text that ends in a newline."""
    schema = TypeAdapter(SceneDescription).json_schema()
    schema["properties"] = {"format": {"const": FORMAT, "type": "integer"}, **schema["properties"]}
    schema["required"] = ["format", *schema.get("required", [])]
    return schema_text(schema)


def key_tables() -> str:
    """A table for each table of a scene file: key, default, meaning."""
    schema = TypeAdapter(SceneDescription).json_schema()
    tables: list[str] = []

    def add(part: dict[str, Any], heading: str, place: str) -> None:
        lines = [f"### {heading}", "", "| Key | Default | Meaning |", "| --- | --- | --- |"]
        keys = part["properties"].items()
        lines += [f"| `{k}` | {_default(k, part)} | {' '.join(v['description'].split())} |" for k, v in keys]
        tables.append("\n".join(lines))
        for key, value in keys:
            for kind in _kinds(value):
                if inner := schema["$defs"].pop(kind, None):
                    where = f"{place}.{key}".strip(".")
                    plant = inner["properties"].get("kind", {}).get("const")
                    add(inner, f'`[[{where}]]` with `kind = "{plant}"`' if plant else f"`[{where}]`", where)

    add(schema, "At the top", "")
    return "\n\n".join(tables)


def guide_with_tables(text: str) -> str:
    """sim/README.md with the tables between its two marks."""
    before, _, after = text.split(_MARK)
    return f"{before}{_MARK}\n\n{key_tables()}\n\n{_MARK}{after}"


def _kinds(value: dict[str, Any]) -> list[str]:
    return re.findall(r"#/\$defs/(\w+)", json.dumps(value))


def _default(key: str, part: dict[str, Any]) -> str:
    value = part["properties"][key]
    if _kinds(value):
        return "none" if "anyOf" in value else "see below"
    if key in part.get("required", []):
        return "needed"
    return f'`"{value["default"]}"`' if isinstance(value["default"], str) else str(value["default"]).lower()


if __name__ == "__main__":
    for name, scene in scenes().items():
        write_scene(FOLDER / f"{name}.toml", scene)
        print(FOLDER / f"{name}.toml")
    (ROOT / "docs" / "schemas" / "scene.schema.json").write_text(scene_schema(), encoding="utf-8")
    for name, text in (run_schemas() | {n: json_schema(model) for n, model in SCHEMA_FILES.items()}).items():
        (ROOT / "docs" / "schemas" / name).write_text(text, encoding="utf-8")
    GUIDE.write_text(guide_with_tables(GUIDE.read_text(encoding="utf-8")), encoding="utf-8")
