"""pycolmap is imported without what it does to a process."""

import signal
import subprocess
import sys


def test_importing_it_takes_no_signal() -> None:
    script = "import os, signal, time, fieldkit.runtime.colmap; os.kill(os.getpid(), signal.SIGTERM)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGTERM, "", "")


def test_a_command_that_has_imported_it_ends_in_words() -> None:
    script = (
        "import os, signal, sys, time\n"
        "from fieldkit.cli.boundary import Boundary\n"
        "with Boundary([]) as boundary:\n"
        "    import fieldkit.reconstruction.mapping.choose\n"
        "    os.kill(os.getpid(), signal.SIGTERM)\n"
        "    time.sleep(30)\n"
        "sys.exit(boundary.exit_code)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (143, "", "Error: ended by SIGTERM\n")
