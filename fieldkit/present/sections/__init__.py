"""fieldkit report: what folders of results hold, read and turned into the content of one page."""
