#!/usr/bin/env python3
"""Checks that OpenGL works without a screen (EGL), and installs the libraries where it may.

    python scripts/system_libraries.py [--install] [--tests]

With --tests it looks for the browser instead that tests open reports in. Needs the standard library only. The exit code
is 0 in any case: only rendering needs these libraries, and `fieldkit doctor` shows what is missing; tests without a
browser are skipped and say so.
"""

import ctypes
import os
import shutil
import subprocess
import sys
from pathlib import Path

PACKAGES = ["libegl1", "libgl1-mesa-dri"]
LINES = """\
  Debian, Ubuntu:  sudo apt-get install libegl1 libgl1-mesa-dri
  Fedora:          sudo dnf install libglvnd-egl mesa-dri-drivers
  Arch:            sudo pacman -S libglvnd mesa"""
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
BROWSER_LINES = """\
  Debian:  sudo apt-get install chromium
  Ubuntu:  sudo snap install chromium
  Fedora:  sudo dnf install chromium
  Arch:    sudo pacman -S chromium"""
EGL_PLATFORM_DEVICE_EXT = 0x313F


def problem():
    """What keeps EGL from working, or None. In a process of its own: a broken driver may end it."""
    done = subprocess.run([sys.executable, __file__, "--probe"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    if done.returncode == 0:
        return None
    return done.stdout.decode().strip() or f"the OpenGL driver crashes (exit code {done.returncode})"


def probe():
    """Load libEGL and start a device's display, which needs a DRI driver. The first failure as text, or None."""
    try:
        egl = ctypes.CDLL("libEGL.so.1")
    except OSError as error:
        return f"libegl1 is missing: {error}"
    egl.eglGetProcAddress.restype = ctypes.c_void_p
    pointer = ctypes.c_void_p

    def function(name, result, *arguments):
        address = egl.eglGetProcAddress(name)
        return ctypes.CFUNCTYPE(result, *arguments)(address) if address else None

    integers = ctypes.POINTER(ctypes.c_int)
    query = function(b"eglQueryDevicesEXT", ctypes.c_uint, ctypes.c_int, ctypes.POINTER(pointer), integers)
    display_of = function(b"eglGetPlatformDisplayEXT", pointer, ctypes.c_uint, pointer, integers)
    if query is None or display_of is None:
        return "libEGL knows no devices: the driver package libgl1-mesa-dri is missing"
    devices, count = (pointer * 16)(), ctypes.c_int()
    query(16, devices, ctypes.byref(count))
    egl.eglInitialize.argtypes = [pointer, integers, integers]
    for device in devices[: count.value]:
        display = display_of(EGL_PLATFORM_DEVICE_EXT, device, None)
        if display and egl.eglInitialize(display, ctypes.byref(ctypes.c_int()), ctypes.byref(ctypes.c_int())):
            return None
    return f"no OpenGL driver starts ({count.value} devices): libgl1-mesa-dri is missing or broken"


def apt_get():
    """The command that installs packages without asking anybody, or None."""
    if not shutil.which("apt-get"):
        return None
    if os.geteuid() == 0:
        return ["apt-get"]
    sudo = shutil.which("sudo")
    if sudo and subprocess.run([sudo, "-n", "true"], stderr=subprocess.DEVNULL).returncode == 0:
        return [sudo, "-n", "apt-get"]
    return None


def install(command, packages):
    """Install packages, with a fresh package list only if the one at hand does not do."""
    arguments = ["install", "-y", "-q", "--no-install-recommends", *packages]
    environment = dict(os.environ, DEBIAN_FRONTEND="noninteractive")
    if subprocess.run(command + arguments, env=environment).returncode != 0:
        subprocess.run([*command, "update", "-q"], env=environment)
        subprocess.run(command + arguments, env=environment)


def browser():
    """Check for a browser, install Debian's if asked to and able to, and say how it stands."""
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    command = apt_get() if found is None and "--install" in sys.argv else None
    if command and debian():
        print("browser for the tests: installing chromium", flush=True)
        install(command, ["chromium"])
        found = shutil.which("chromium")
    if found:
        print(f"browser for the tests: {found}")
    else:
        print(
            f"browser for the tests: none was found, so tests of reports are skipped; install one with\n{BROWSER_LINES}"
        )


def debian():
    """Whether this is Debian: Ubuntu's package of that name only asks for a snap, which may not run here."""
    try:
        return "ID=debian" in Path("/etc/os-release").read_text(encoding="utf-8").splitlines()
    except OSError:
        return False


def main():
    """Check, install if asked to and able to, and say how it stands."""
    if "--tests" in sys.argv:
        browser()
        return
    if "--probe" in sys.argv:
        found = probe()
        if found:
            print(found)
        sys.exit(1 if found else 0)
    found = problem()
    command = apt_get() if found and "--install" in sys.argv else None
    if command:
        print(f"system libraries: {found}; installing {' '.join(PACKAGES)}", flush=True)
        install(command, PACKAGES)
        found = problem()
    if found:
        print(f"system libraries: {found}.\nRendering (make demo) needs them; install them with\n{LINES}")
    else:
        print("system libraries: OpenGL works without a screen")


if __name__ == "__main__":
    main()
