"""Random missions that a vehicle can fly, for property tests."""

from dataclasses import astuple

from hypothesis import strategies as st

from fieldkit.routing.mission import Fence, GeoPoint, Home, Mission, Shot, Via


@st.composite
def missions(draw: st.DrawFn, most: int = 12) -> Mission:
    """One to ``most`` stops within 100 m of a home anywhere but at the poles, every photograph within −90…30°."""
    latitude = draw(st.floats(-80, 80))
    # Not 0, 0: there it means the present place.
    longitude = draw(st.floats(0.1, 179.9) | st.floats(-179.9, -0.1))

    def place(low: float = 0.5) -> GeoPoint:
        return GeoPoint(
            latitude + draw(st.floats(-9e-4, 9e-4)),
            longitude + draw(st.floats(-9e-4, 9e-4)),
            draw(st.floats(low, 60.0)),
        )

    stops: list[Shot | Via] = []
    for station in range(draw(st.integers(1, most))):
        if draw(st.booleans()):
            stops.append(Via(*astuple(place())))
        stops.append(Shot.at(place(), draw(st.floats(0, 359.999)), draw(st.floats(-90, 30)), "plot", station))
    ring = tuple((latitude + a, longitude + b) for a, b in ((-1e-3, -1e-3), (-1e-3, 1e-3), (1e-3, 1e-3), (1e-3, -1e-3)))
    return Mission(
        "random",
        Home(latitude, longitude, draw(st.none() | st.floats(1.0, 4000.0))),
        draw(st.floats(1.0, 60.0)),
        tuple(stops),
        place(),
        speed_mps=draw(st.floats(0.1, 15.0)),
        settle_s=draw(st.floats(0.0, 10.0)),
        exposure_s=draw(st.floats(0.0, 5.0)),
        fence=draw(st.sampled_from([Fence(), Fence(inside=(ring,))])),
    )
