"""True traits of scenes, kept from run to run."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

from fieldkit.clouds.volume import Volume
from fieldkit.files import write_atomic
from fieldkit.planning.objective.simulated import Proxy
from fieldkit.scenes.library import find_scene
from fieldkit.scenes.scene_file import read_scene
from fieldkit_sim.truth import TrueTraits, true_traits

FOLDER = "scenes"


def kept_truth(folder: Path, scene: str, proxy: Proxy | None = None) -> tuple[Volume, TrueTraits]:
    """Volume of interest and true traits of a scene, read from ``folder``, or computed and written there.

    Args:
        folder: of captures.
        scene: by name.
        proxy: of the scene, if it is built already.
    """
    path = folder / FOLDER / f"{scene}.json"
    if path.is_file():
        found = json.loads(path.read_text(encoding="utf-8"))
        if "traits" in found:
            return Volume(tuple(found["lower_m"]), tuple(found["upper_m"])), TrueTraits(**found["traits"])
    proxy = proxy or Proxy.from_description(read_scene(find_scene(scene)))
    truth = true_traits(proxy.scene.meshes, proxy.volume)
    path.parent.mkdir(parents=True, exist_ok=True)
    told = {"lower_m": proxy.volume.lower, "upper_m": proxy.volume.upper, "traits": asdict(truth)}
    write_atomic(path, json.dumps(told) + "\n")
    return proxy.volume, truth
