"""The numbers that WPML has for DJI's aircraft and their cameras."""

from __future__ import annotations

import re
from dataclasses import dataclass

from fieldkit.errors import MissionError
from fieldkit.vehicles.vehicle import Vehicle


@dataclass(frozen=True)
class DjiModel:
    """What WPML calls an aircraft and its camera.

    Attributes:
        drone: droneEnumValue and droneSubEnumValue.
        payload: payloadEnumValue; None where the aircraft's own app writes none.
        lens: payloadLensIndex of its colour camera.
    """

    drone: tuple[int, int]
    payload: int | None
    lens: str = "wide"


# What a profile's title may hold. Numbers: Cloud API, "Product support" (type, sub_type; type of the camera). The Minis
# are not in it; 68 is what DJI Fly writes for them and for its other consumer aircraft, without a payload.
_MODELS: tuple[tuple[str, DjiModel], ...] = (
    (r"(mavic 3|m3) ?(enterprise|e)\b", DjiModel((77, 0), 66)),
    (r"(mavic 3|m3) ?(thermal|t)\b", DjiModel((77, 1), 67)),
    (r"(mavic 3|m3) ?(multispectral|m)\b", DjiModel((77, 2), 68, "visable")),  # DJI's spelling
    (r"(matrice|m) ?4 ?e\b", DjiModel((99, 0), 88)),
    (r"(matrice|m) ?4 ?t\b", DjiModel((99, 1), 89)),
    (r"(matrice|m) ?3 ?td\b", DjiModel((91, 1), 81)),
    (r"(matrice|m) ?3 ?d\b", DjiModel((91, 0), 80)),
    (r"(matrice|m) ?30 ?t\b", DjiModel((67, 1), 53)),
    (r"(matrice|m) ?30\b", DjiModel((67, 0), 52)),
    (r"mini (4|5) pro\b", DjiModel((68, 0), None)),
)
_CARRIERS = ((r"(matrice|m) ?350\b", (89, 0)), (r"(matrice|m) ?300\b", (60, 0)))
_CAMERAS = ((r"\bh20t\b", 43), (r"\bh20n\b", 61), (r"\bh20\b", 42), (r"\bh30t\b", 83), (r"\bh30\b", 82))
"""Aircraft that carry different cameras, and these: the title names both."""


def dji_model(vehicle: Vehicle) -> DjiModel:
    """The model that a profile's title names.

    Raises:
        MissionError: it names none, or no camera where the aircraft carries different ones.
    """
    title = vehicle.title.lower()
    for pattern, model in _MODELS:
        if re.search(pattern, title):
            return model
    for pattern, drone in _CARRIERS:
        if re.search(pattern, title):
            payload = next((number for name, number in _CAMERAS if re.search(name, title)), None)
            if payload is not None:
                return DjiModel(drone, payload)
            raise MissionError(
                f"{vehicle.title!r} does not name the camera, and WPML needs its number",
                remedy="Name it in the profile's title, such as DJI Matrice 350 with H20T.",
            )
    raise MissionError(
        f"{vehicle.title!r} is no DJI model that WPML has a number for",
        remedy="Name the model in the profile's title, such as DJI Mavic 3 Enterprise, or use --format litchi.",
    )
