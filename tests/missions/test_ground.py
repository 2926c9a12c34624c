"""No mission into the plants, in any format: what exports and checks make of plots, plans and mission.json."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from fieldkit.cli.main import main
from fieldkit.missions.export_mission import export_mission
from fieldkit.missions.ground import ground_of
from fieldkit.results.plan_file import save_plan
from fieldkit.sites.site_file import load_site
from fieldkit.vehicles.vehicle_file import load_vehicle
from tests.missions.test_export import planned

FLOWN = [("ardupilot-pitch", "plan", ".plan"), ("dji-mini-4-pro", "litchi", ".csv")]
SITE = """\
format = 1
ceiling_m = 30.0
[home]
latitude_deg = 50.8649
longitude_deg = 6.4473
amsl_m = 92.0
"""
Answer = dict[str, Any]


def plots_file(folder: Path, name: str, heights: Sequence[float | None], *, half_m: float = 0.7, **more: Any) -> Path:
    """Plots in a row, each a rectangle of 2.6 × 1.4 m with room for the stations of `planned` beside the plants."""
    features = []
    for k, height in enumerate(heights):
        east, north = 6.4473 + 1.2e-4 * k, 50.8650
        dx, dy = 1.3 / 70_300, half_m / 111_260
        ring = [[east + x * dx, north + y * dy] for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1))]
        known = {} if height is None else {"plant_height_m": height}
        features.append(
            {
                "type": "Feature",
                "properties": {"plot_id": f"P{k}", **known, **more},
                "geometry": {"type": "Polygon", "coordinates": [ring]},
            }
        )
    (folder / name).write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return folder / name


class Field:
    """A folder with a site, a plan of plants 0.9 m high, and the commands."""

    def __init__(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self.folder, self.capsys = folder, capsys
        (folder / "site.toml").write_text(SITE)
        self.plan = planned(6, height_m=2.0)
        (folder / "plan").mkdir()
        save_plan(folder / "plan" / "plan.json", self.plan)

    def export(self, vehicle: str, form: str, plots: Path, *more: str) -> tuple[int, str]:
        call = ["export-mission", str(self.folder / "plan"), "--vehicle", vehicle, "--format", form, "--no-picture"]
        call += ["--site", str(self.folder / "site.toml"), "--plots", str(plots), "-o", str(self.folder / "m"), *more]
        code = main([*call, "--overwrite"])
        printed = self.capsys.readouterr()
        return code, " ".join((printed.err + printed.out).split())

    def check(self, suffix: str, vehicle: str, plots: Path | None = None, *more: str) -> tuple[int, Answer, str]:
        """Exit code, JSON, and the verdict for people: of .plan files as it is printed, else as it would be."""
        call = ["check-mission", str(self.folder / f"m{suffix}"), "--vehicle", vehicle, *more]
        if plots is not None:
            call += ["--site", str(self.folder / "site.toml"), "--plots", str(plots)]
        code = main([*call, "--json"])
        answer = json.loads(self.capsys.readouterr().out)
        verdict = {True: "may be flown", False: "must not be flown"}.get(answer["ok"], "not checked against plants")
        if suffix == ".plan":
            assert main(call) == code
            verdict = self.capsys.readouterr().out.splitlines()[0].rpartition("; ")[2]
        return code, answer, verdict


@pytest.fixture
def field(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Field:
    return Field(tmp_path, capsys)


def codes(answer: Answer, severity: str = "error") -> set[str]:
    return {finding["code"] for finding in answer["findings"] if finding["severity"] == severity}


@pytest.mark.parametrize(("vehicle", "form", "suffix"), FLOWN)
def test_a_mission_into_the_plants_is_found_with_and_without_its_record_and_plan(field, vehicle, form, suffix) -> None:
    as_planned, tall = (plots_file(field.folder, f"{h}.geojson", [h, h]) for h in (0.9, 2.3))
    unknown, one = (plots_file(field.folder, f"one-{k}.geojson", [None, k]) for k in (None, 0.9))
    with_plan = ["--plan", str(field.folder / "plan")]
    code, told = field.export(vehicle, form, as_planned, "--adjust")
    assert code == 0
    assert "clear of plants up to 0.90 m high" in told

    def expect(ok: bool | None, *given: Any, code: int | None = None) -> Answer:
        found, answer, told = field.check(suffix, vehicle, *given)
        assert (found, answer["ok"]) == (0 if ok else 5 if code is None else code, ok), answer
        assert ("may be flown" in told, "must not be flown" in told) == (ok is True, ok is False)
        assert told.startswith("not checked against plants") == (ok is None)
        return answer

    # By mission.json, alone and for the same plots: nothing is among plants of the height that it was exported for.
    for given in (None, as_planned, unknown):
        assert expect(True, given)["checked_against_plants"]
    # Taller ones, by the plots' outlines and by the plan.
    for more in ([], with_plan):
        assert "leg-plants" in codes(expect(False, tall, *more))
    (field.folder / "m.mission.json").unlink()
    assert codes(expect(False, tall)) == {"leg-plants"}
    expect(True, as_planned)  # 2 m high, all of them are over the outline
    # Nobody says how high: never "may be flown".
    for more in ([], with_plan):
        answer = expect(None, unknown, *more)
        assert not answer["checked_against_plants"]
        assert [plot["plot"] for plot in answer["plants"] if not plot["checked"]] == ["P0", "P1"]
        assert "plants-unchecked" in codes(answer, "warning")
    answer = expect(True, one)  # 30 % higher than the other's
    assert answer["plants"][0]["plant_height_m"] == pytest.approx(1.17)
    assert "plant-height-taken" in codes(answer, "warning")
    expect(True, unknown, "--plant-height", "0.9")
    assert not expect(None, code=0)["checked_against_plants"]


def test_an_export_needs_the_height_of_the_plants(field: Field) -> None:
    none, unknown = (plots_file(field.folder, f"{h}.geojson", [h, None, None]) for h in (None, 0.9))

    def exported(plots: Path, *more: str, code: int = 0) -> str:
        done, told = field.export("dji-mini-4-pro", "litchi", plots, "--adjust", *more)
        assert done == code, told
        return told

    assert "--plant-height METRES" in exported(none, code=5)
    assert not list(field.folder.glob("m.*"))
    exported(unknown, "--plant-height", "164", code=2)
    assert "clear of plants up to 1.20 m high" in exported(unknown, "--plant-height", "1.2")
    assert "clear of plants up to 1.17 m high" in exported(none, "--plant-height", "unknown")
    told = exported(unknown)
    assert "clear of each plot's plants, 0.90 to 1.17 m high" in told
    assert "Warning: P1 and P2: nobody says how high its plants are: they count as 1.17 m high" in told
    record = json.loads((field.folder / "m.mission.json").read_text())
    assert [plot["plants"]["height_m"] for plot in record["plots"]] == pytest.approx([0.9, 1.17, 1.17], abs=0.01)
    code, told = field.export("dji-mini-4-pro", "litchi", unknown, "--plant-height", "2.1")
    assert code == 5
    assert "too low over the plants of P0" in told


@pytest.mark.parametrize("change", ["edited", "moved", "taller", "bolder vehicle", "none"])
def test_a_record_counts_for_the_very_file_plots_plants_and_clearance(field: Field, change: str) -> None:
    """Of a plot of unknown outline."""
    site = load_site(field.folder / "site.toml", plots_file(field.folder, "p.geojson", [0.9]))
    site = site.with_each(lambda plot: plot.model_copy(update={"length_m": None, "width_m": None}))
    plan, vehicle = planned(6, height_m=2.0), load_vehicle("ardupilot-pitch")
    done = export_mission(plan, vehicle, site, field.folder / "m.plan", picture=False)
    clearance_m = vehicle.clearance_m
    (plot,) = site.plots
    if change == "edited":
        done.files[0].write_text(done.files[0].read_text() + " ")
    elif change == "moved":
        plot = plot.model_copy(update={"latitude_deg": plot.latitude_deg + 2e-6})
    elif change == "taller":
        plot = plot.model_copy(update={"plant_height_m": 1.0})
    elif change == "bolder vehicle":
        clearance_m += 0.1
    ground = ground_of(done.files[0], site.model_copy(update={"plots": (plot,)}), clearance_m)
    assert ground.unchecked.keys() == (set() if change == "none" else {"P0"})


def test_fitted_plans_beside_a_mission_say_where_its_plants_are(field: Field) -> None:
    stated = field.plan.model_copy(update={"plant_height_m": 0.9})
    save_plan(field.folder / "plan" / "plan.json", stated)
    plots = plots_file(field.folder, "p.geojson", [1.1, 0.9], row_spacing_m=0.75)
    assert field.export("ardupilot-pitch", "plan", plots)[0] == 0
    ground = ground_of(field.folder / "m.plan", None, 0.5)
    assert ground is not None
    assert [plot.row_spacing_m for plot in ground.site.plots] == [0.75, 0.75]
    assert set(ground.plans) == {"P0"}
    assert field.check(".plan", "ardupilot-pitch")[1]["ok"] is True
    (field.folder / "m-P0.json").write_text("{}")  # another file of that name
    changed = ground_of(field.folder / "m.plan", None, 0.5)
    assert set(changed.plans) == set()


def test_a_plot_that_is_flown_over_and_not_given_is_not_checked(field: Field) -> None:
    assert field.export("px4-gimbal", "plan", plots_file(field.folder, "two.geojson", [0.9, 0.9]), "--adjust")[0] == 0
    one = plots_file(field.folder, "one.geojson", [0.9])
    code, answer, told = field.check(".plan", "px4-gimbal", one)
    assert (code, answer["ok"]) == (5, None)
    assert told.endswith("not checked against plants: P1")


@pytest.mark.parametrize(("between", "over"), [(1.2e-4, False), (3.5e-5, True)])
def test_plots_that_are_not_flown_are_kept_clear_of_with_and_without_the_record(
    field: Field, between: float, over: bool
) -> None:
    """Those of the site file beside --plots: four plots side by side, the first of which is flown."""
    every = plots_file(field.folder, "every.geojson", [1.8] * 4)
    first = plots_file(field.folder, "first.geojson", [0.9])
    (field.folder / "site.toml").write_text('plots = "every.geojson"\n' + SITE)
    assert field.export("ardupilot-pitch", "plan", first)[0] == 0
    document = json.loads(every.read_text())
    for k, feature in enumerate(document["features"]):
        ring = feature["geometry"]["coordinates"][0]
        feature["geometry"]["coordinates"] = [[[x + (between - 1.2e-4) * k, y] for x, y in ring]]
    every.write_text(json.dumps(document))
    for _ in range(2):
        _, answer, _ = field.check(".plan", "ardupilot-pitch", first)
        assert answer["ok"] is not over
        assert {f["code"] for f in answer["findings"]} == ({"leg-plants"} if over else set())
        (field.folder / "m.mission.json").unlink(missing_ok=True)
    code, told = field.export("ardupilot-pitch", "plan", first)
    assert code == (5 if over else 0), told
    assert ("too low over the plants of P1" in told) == over
    assert field.export("ardupilot-pitch", "plan", first, "--adjust")[0] == 0
    record = json.loads((field.folder / "m.mission.json").read_text())
    assert [plot["name"] for plot in record["neighbours"]] == ["P1", "P2", "P3"]


@pytest.mark.parametrize(("vehicle", "form", "suffix"), FLOWN)
def test_two_heights_on_a_slope_below_home(field: Field, vehicle: str, form: str, suffix: str) -> None:
    """What is exported passes its check; stations lower than home are not too low over their own ground.

    Plants 1 cm higher than the plan's are its own, at the export as at the check.
    """
    low = {"slope_percent": 12.0, "uphill_heading_deg": 20.0, "height_m": -1.5, "datum": "home"}
    plots = plots_file(field.folder, "slope.geojson", [0.91, 1.2], **low)
    code, told = field.export(vehicle, form, plots, "--adjust")
    assert code == 0, told
    for file in field.folder.glob("m-*.json"):
        file.unlink()  # the plans
    (field.folder / "plan" / "plan.json").unlink()
    code, answer, told = field.check(suffix, vehicle, plots)
    assert (code, answer["ok"]) == (0, True), answer["findings"]
