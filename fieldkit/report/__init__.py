"""Pictures and tables of results.

Reads the values of reports (`fieldkit.results.evaluation`) and clouds, and writes pictures; nothing here reconstructs.
"""
