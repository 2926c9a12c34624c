"""The objective r(z) of sets of cameras, by simulated or recorded photographs."""
