"""What a set of cameras should be worth, without a photograph."""
