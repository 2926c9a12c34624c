"""fieldkit replay."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from fieldkit.cli.common import DebugOption, JsonOption, SeedOption, emit_json, say
from fieldkit.cli.option_groups import grouped
from fieldkit.figures.style import format_seconds
from fieldkit.wording import count


@dataclass(frozen=True)
class FaultOptions:
    """What the link does wrong."""

    loss: Annotated[float, Option("--loss", metavar="SHARE", min=0.0, max=1.0, help="Of packets, each way.")] = 0.0
    duplicate: Annotated[
        float, Option("--duplicate", metavar="SHARE", min=0.0, max=1.0, help="Of packets, each way.")
    ] = 0.0
    delay: Annotated[
        float, Option("--delay", metavar="S", min=0.0, max=60.0, help="Mean time under way, each way.")
    ] = 0.0


@grouped
def command(
    recording: Annotated[Path, Argument(help="Telemetry log of a flight (.tlog).")],
    *,
    serve: Annotated[
        str,
        Option("--serve", metavar="URL", help="udpout://127.0.0.1:PORT, as the SITL does, or udpin://127.0.0.1:PORT."),
    ] = "udpout://127.0.0.1:14550",
    speed: Annotated[float, Option("--speed", metavar="X", help="Vehicle seconds per second.")] = 1.0,
    begin: Annotated[float, Option("--from", metavar="S", min=0.0, help="Where in the recording to begin.")] = 0.0,
    duration: Annotated[
        float | None, Option("--for", metavar="S", min=0.0, help="Stop after this time; else at Ctrl-C.")
    ] = None,
    rate: Annotated[
        float | None, Option("--rate", metavar="HZ", help="At most so many of each message per vehicle second.")
    ] = None,
    faults: FaultOptions,
    signing_key: Annotated[
        Path | None, Option("--signing-key", metavar="FILE", help="Sign with it, and hear nobody who does not.")
    ] = None,
    seed: SeedOption = 0,
    as_json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Stand in for a vehicle: send a recording's telemetry on this machine and take missions as ArduCopter 4.5.6 does.

    Any ground station on this machine can connect, upload and download missions and fences. Nothing flies.

    Examples:
        fieldkit replay sim/sitl/mount_then_yaw.tlog
        fieldkit replay sim/sitl/probe_items.tlog --from 45 --loss 0.05 --duplicate 0.02 --delay 0.2
        fieldkit replay flight.tlog --serve udpin://127.0.0.1:14551 --speed 10 --for 60

    Exit codes:
        0  done
        2  wrong usage
        3  the recording or the key cannot be used
        6  the port is taken

    See Also:
        fieldkit upload
    """
    from fieldkit.link.signing import read_key
    from fieldkit.standin.faults import Faults
    from fieldkit.standin.recording import read_recording
    from fieldkit.standin.replay import Replay

    key = None if signing_key is None else read_key(signing_key)
    source = read_recording(recording)
    vehicle = Replay(
        source, serve=serve, speed=speed, begin_s=begin, rate_hz=rate, key=key,
        faults=Faults(loss=faults.loss, duplicate=faults.duplicate, delay_s=faults.delay, seed=seed),
    )  # fmt: skip
    with vehicle:
        if not as_json:
            say(
                f"{recording.name}: {format_seconds(source.length_s)} of vehicle {source.system}; "
                f"connect a station to {vehicle.url}"
            )
            say("Ctrl-C ends it." if duration is None else f"It ends by itself after {format_seconds(duration)}.")
        with suppress(KeyboardInterrupt):  # the way to end it
            vehicle.wait(duration)
    held, traffic = vehicle.autopilot, vehicle.traffic
    if as_json:
        emit_json({
            "recording": recording, "heard": traffic.heard, "said": traffic.said, "lost": traffic.lost,
            "refused": traffic.refused, "items": len(held.items), "fence_items": len(held.fence.items),
            "armed": held.armed, "mode": held.mode,
        })  # fmt: skip
    else:
        say(
            f"{count(traffic.heard, 'packet')} heard, {traffic.said} sent, {traffic.lost} lost; the vehicle holds "
            f"{count(len(held.items), 'mission item')} and {len(held.fence.items)} of a fence"
        )
