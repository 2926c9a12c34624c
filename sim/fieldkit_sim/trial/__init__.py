"""A block of a trial as a scene: a mesh of plants for each plot on soil that has texture everywhere."""
