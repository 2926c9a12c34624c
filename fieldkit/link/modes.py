"""ArduCopter's custom modes (https://ardupilot.org/copter/docs/flight-modes.html)."""

STABILIZE, AUTO, GUIDED, LOITER, RTL, LAND = 0, 3, 4, 5, 6, 9
