"""The link to a vehicle: recordings, an autopilot's side of the mission protocol, and uploading."""
