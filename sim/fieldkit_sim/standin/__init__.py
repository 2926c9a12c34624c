"""A stand-in for a vehicle: a recorded flight, replayed, that answers a ground station."""
