"""MAVLink frames and messages, for whatever reads or speaks them."""
