"""Pictures and tables of results.

Reads the values of reports (`fieldkit.evaluation.schema`) and clouds, and writes pictures; nothing here reconstructs.
"""
