"""Sparse models as arrays, for the stage cache. A model always passes through its file form, so that a run that
computed it and a run that found it in the cache go on from the same bytes.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from fieldkit.reconstruction.colmap import pycolmap

Arrays = dict[str, np.ndarray]


def model_to_arrays(model: pycolmap.Reconstruction, prefix: str = "") -> Arrays:
    """COLMAP's binary files as uint8 arrays by file name."""
    with tempfile.TemporaryDirectory(prefix="fieldkit-") as folder:
        model.write_binary(folder)
        return {
            f"{prefix}{path.stem}": np.frombuffer(path.read_bytes(), dtype=np.uint8)
            for path in sorted(Path(folder).glob("*.bin"))
        }


def arrays_to_model(arrays: Arrays, prefix: str = "") -> pycolmap.Reconstruction:
    """The model that `model_to_arrays` packed."""
    with tempfile.TemporaryDirectory(prefix="fieldkit-") as folder:
        for name, data in arrays.items():
            if name.startswith(prefix):
                (Path(folder) / f"{name.removeprefix(prefix)}.bin").write_bytes(data.tobytes())
        model = pycolmap.Reconstruction()
        model.read_binary(folder)
        return model
