"""ArduPilot: the items it is given, and what it makes of them."""
