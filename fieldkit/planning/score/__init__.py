"""The expected cost of a set of cameras, without photographs."""
