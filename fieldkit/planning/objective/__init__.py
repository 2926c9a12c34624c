"""What a set of cameras is worth: r(z), of simulated and of recorded photographs."""
