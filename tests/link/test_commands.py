"""fieldkit upload, and the stand-in's own command."""

import json
import socket
import threading
from pathlib import Path

import pytest

from fieldkit.cli.options import grouped
from fieldkit.cli.upload import command
from fieldkit.errors import MissionError
from fieldkit.missions.items import MissionItem
from fieldkit_sim.__main__ import main
from fieldkit_sim.standin.recording import Recording
from fieldkit_sim.standin.replay import Replay

upload = grouped(command)
SITE = """\
format = 1

[home]
latitude_deg = 50.8649
longitude_deg = 6.4473
amsl_m = 92.0

[[plots]]
latitude_deg = 50.865
longitude_deg = 6.4473
length_m = 1.0
width_m = 1.0
plant_height_m = 0.1
"""


@pytest.fixture
def mission(tmp_path: Path, flown: tuple[MissionItem, ...]) -> Path:
    rows = ["QGC WPL 110", "0\t1\t0\t16\t0\t0\t0\t0\t50.86490000\t6.44730000\t92.000000\t1"]
    for number, item in enumerate(flown, start=1):
        numbers = "\t".join(f"{value:.8f}" for value in item.params)
        rows.append(f"{number}\t0\t{item.frame}\t{item.command}\t{numbers}\t1")
    file = tmp_path / "field.waypoints"
    file.write_text("\n".join(rows) + "\n")
    (tmp_path / "site.toml").write_text(SITE)
    return file


@pytest.fixture
def vehicle(recording: Recording) -> Replay:
    return Replay(recording, speed=10.0, begin_s=60.0, rate_hz=5.0)


def test_upload(mission: Path, vehicle: Replay, capsys: pytest.CaptureFixture[str]) -> None:
    with vehicle:
        upload(mission, vehicle.url, as_json=True)
        printed = json.loads(capsys.readouterr().out)
        assert len(vehicle.autopilot.items) == 68
        upload(mission, vehicle.url)
        assert "The ArduPilot holds the new mission whole: 67 items" in capsys.readouterr().out
    assert printed["vehicle_holds"] == "new mission"
    assert (printed["items"], printed["attempts"]) == (67, 1)


def swapped(mission: Path) -> Path:
    """The mission with longitude first, as one column for the other."""
    file = mission.with_name("swapped.waypoints")
    rows = [line.split("\t") for line in mission.read_text().splitlines()]
    file.write_text("\n".join("\t".join([*row[:8], *row[9:7:-1], *row[10:]]) for row in rows) + "\n")
    return file


def test_a_mission_with_errors_is_refused_before_anybody_is_called(mission: Path) -> None:
    """Nobody is at this address: what speaks against the mission is said first."""
    nowhere, site = "udpin://127.0.0.1:0", mission.parent / "site.toml"
    with pytest.raises(
        MissionError, match=r"the file's home is \d+\.\d km from the site's.*Nothing was sent"
    ) as caught:
        upload(swapped(mission), nowhere, site=site)
    assert caught.value.exit_code == 5
    assert "--force" in caught.value.remedy


def test_force_sends_what_has_errors_and_says_so(mission, vehicle, capsys) -> None:
    site = mission.parent / "site.toml"
    with vehicle:
        upload(swapped(mission), vehicle.url, site=site, force=True)
        assert "sent in spite of" in capsys.readouterr().out
        assert len(vehicle.autopilot.items) == 68
        upload(swapped(mission), vehicle.url, site=site, force=True, as_json=True)
    printed = json.loads(capsys.readouterr().out)
    assert "other-home" in {finding["code"] for finding in printed["findings"]}


def test_a_fence_stays_behind_and_that_is_said(mission, vehicle, capsys) -> None:
    site = mission.with_name("fenced.toml")
    corners = "[[50.864, 6.446], [50.864, 6.449], [50.867, 6.449], [50.867, 6.446]]"
    site.write_text(SITE.replace("[home]", f"fence = [{corners}]\n\n[home]"))
    with vehicle:
        upload(mission, vehicle.url, site=site)
    assert "fence and rally points are not uploaded" in capsys.readouterr().err


def test_replay(sitl: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.bind(("127.0.0.1", 0))
        station.settimeout(10)
        heard = []
        listen = threading.Thread(target=lambda: heard.append(station.recv(300)))
        listen.start()
        url = f"udpout://127.0.0.1:{station.getsockname()[1]}"
        options = ["--serve", url, "--from", "60", "--speed", "10", "--for", "0.3", "--loss", "0.2"]
        assert main(["replay", str(sitl / "probe_items.tlog"), *options]) == 0
        listen.join()
    assert heard
    assert heard[0][:1] == b"\xfd"
    said = capsys.readouterr().err
    assert "Connect a station to udpin://127.0.0.1:" in said
    assert "It holds 0 mission items; 0 packets heard, " in said
    assert main(["replay", str(sitl / "hold0.json")]) == 3
