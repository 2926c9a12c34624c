"""python -m fieldkit_sim replay: stand in for a vehicle."""

from __future__ import annotations

import argparse
import sys
from contextlib import suppress
from pathlib import Path

from fieldkit.errors import FieldkitError
from fieldkit_sim.standin.recording import read_recording
from fieldkit_sim.standin.replay import Faults, Replay

_EPILOG = """\
python -m fieldkit_sim replay sim/sitl/mount_then_yaw.tlog
python -m fieldkit_sim replay sim/sitl/probe_items.tlog --from 45 --loss 0.05"""


def main(arguments: list[str] | None = None) -> int:
    """Send a recording's telemetry on this machine and take missions as ArduCopter 4.5.6 does, until Ctrl-C."""
    parser = argparse.ArgumentParser("python -m fieldkit_sim", formatter_class=argparse.RawDescriptionHelpFormatter)
    replay = parser.add_subparsers(dest="command", required=True).add_parser(
        "replay",
        help="Stand in for a vehicle, by the recording of a real one.",
        description=main.__doc__,
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    replay.add_argument("recording", type=Path, help="telemetry log of a flight (.tlog)")
    replay.add_argument(
        "--serve",
        default="udpout://127.0.0.1:14550",
        metavar="URL",
        help="udpout://127.0.0.1:PORT, as the SITL does, or udpin://127.0.0.1:PORT",
    )
    for name, default, what in (
        ("speed", 1.0, "vehicle seconds per second"),
        ("from", 0.0, "where in the recording to begin, seconds"),
        ("for", None, "stop after so many seconds; else at Ctrl-C"),
        ("loss", 0.0, "share of packets, each way"),
        ("duplicate", 0.0, "share of packets, each way"),
        ("delay", 0.0, "mean time under way, each way, seconds"),
    ):
        replay.add_argument(f"--{name}", type=float, default=default, metavar="X", help=what)
    given = vars(parser.parse_args(arguments))
    try:
        faults = Faults(loss=given["loss"], duplicate=given["duplicate"], delay_s=given["delay"])
        source = read_recording(given["recording"])
        with Replay(
            source, serve=given["serve"], speed=given["speed"], begin_s=given["from"], faults=faults
        ) as vehicle:
            sys.stderr.write(f"Connect a station to {vehicle.url}; Ctrl-C ends it.\n")
            with suppress(KeyboardInterrupt):  # the way to end it
                vehicle.wait(given["for"])
    except FieldkitError as error:
        sys.stderr.write(f"{error}\n")
        return error.exit_code
    items, traffic = len(vehicle.autopilot.items), vehicle.traffic
    sys.stderr.write(f"It holds {items} mission items; {traffic.heard} packets heard, {traffic.lost} lost.\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
