"""Calibrated rigs: photographs that count by the poses stated of them, where the pictures tie them too weakly."""

from __future__ import annotations

from dataclasses import replace

from fieldkit.reconstruction.colmap_model import new_model, to_rigid
from fieldkit.reconstruction.mapping.state import Belief, Inputs, Mapped
from fieldkit.results.evaluation import ImageReport
from fieldkit.results.finding import POSES_STATED, Finding
from fieldkit.runtime.colmap import pycolmap
from fieldkit.wording import count


def with_stated_poses(inputs: Inputs, belief: Belief, mapped: Mapped | None) -> Mapped | None:
    """A model with photographs at their stated poses, where these are exact (`PosePrior.exact`).

    Matches that tie all photographs together know better than a rig where its cameras are: to such a model those are
    added that it lacks. Where it falls into groups, or has not even half of them, all stand where they are stated to,
    and it has no points. ``mapped`` is the model by matches; None where they make none.
    """
    stated = {name: prior.pose for name, prior in belief.priors.by_name.items() if prior.exact}
    names, cameras = inputs.names, belief.cameras
    if len(stated) < 2 or not cameras.known:
        return mapped
    if mapped is None or not _tied(mapped):
        images = [
            ImageReport(name=name, features=len(keyed.features), registered=False, reason="its pose is not stated")
            for name, keyed in zip(names, inputs.keyed, strict=True)
        ]
        kept = replace(mapped or _none(belief), model=new_model((), cameras.cameras, (), (), ()), model_sizes=(),
                       metric=True, images=tuple(images), findings=(), weakest=None, flat=False)  # fmt: skip
    else:
        kept = mapped
    missing = {image.name for image in kept.images if not image.registered and image.name in stated}
    if not missing:
        return kept
    free = max((int(i) for i in kept.model.images), default=0) + 1
    for k, name in enumerate(names):
        if name in missing:
            camera, keypoints = cameras.camera_of[k] + 1, inputs.keyed[k].features.points
            image = pycolmap.Image(name=name, camera_id=camera, image_id=free + k, keypoints=keypoints)
            kept.model.add_image_with_trivial_frame(image, to_rigid(stated[name]))
    update = {"stated": True, "reason": ""}
    message = (
        f"{count(len(missing), 'photograph counts', 'photographs count', of=len(names))} by stated poses: nothing in "
        "the pictures confirms them, for too few matches tie these photographs to others; where a pose is wrong, so is "
        "the cloud"
    )
    return replace(
        kept,
        images=tuple(image.model_copy(update=update) if image.name in missing else image for image in kept.images),
        findings=(*kept.findings, Finding(inputs.capture.folder.name, POSES_STATED, message)),
    )


def _tied(mapped: Mapped) -> bool:
    """Whether a model by matches is one group of half of the photographs or more, in the frame of what is known."""
    half = 2 * sum(image.registered for image in mapped.images) >= len(mapped.images)
    return mapped.metric and half and len(set(mapped.groups.values())) == 1


def _none(belief: Belief) -> Mapped:
    sources = dict(zip(belief.cameras.keys, belief.cameras.sources, strict=True))
    return Mapped("prior", pycolmap.Reconstruction(), (), True, (), sources, 0, 0, belief.notes)
