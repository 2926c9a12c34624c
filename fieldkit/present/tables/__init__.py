"""The figures of results as values to show: one function for each table, whatever it is shown in."""
