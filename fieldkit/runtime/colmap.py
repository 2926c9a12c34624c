"""pycolmap, imported here alone, so that it does not speak and does not take signals.

Importing it installs a handler of SIGTERM that prints stacks of C++ and ends the process at once.
"""

import signal
from contextlib import suppress

_MASKS = hasattr(signal, "pthread_sigmask")  # not on Windows
_held = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM}) if _MASKS else set()
_handler = signal.getsignal(signal.SIGTERM)
try:
    import pycolmap as pycolmap
finally:
    if _handler is not None:  # not one of C
        with suppress(ValueError):  # only the main thread may set handlers
            signal.signal(signal.SIGTERM, _handler)
    if _MASKS:
        signal.pthread_sigmask(signal.SIG_SETMASK, _held)

# COLMAP logs every step to stderr, which belongs to the person at the terminal; only fatal messages stay.
pycolmap.logging.minloglevel = pycolmap.logging.FATAL.value
