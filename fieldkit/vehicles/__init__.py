"""What a vehicle can do: its profile, and the files that hold profiles."""
