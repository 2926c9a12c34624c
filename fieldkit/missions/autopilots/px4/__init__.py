"""PX4: the items it is given."""
