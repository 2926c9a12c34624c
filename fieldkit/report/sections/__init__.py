"""fieldkit report: results read from folders, and turned into the content of one page."""
