"""The demo: a small block of a trial, flown by a planned pattern and by an app's grid, both beside the truth."""
