"""A plan on the plots of a site: the vehicle, where stations come to lie, and whether the plan fits there."""
