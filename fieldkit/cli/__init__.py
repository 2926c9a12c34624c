"""The command line: a file for each command, each a thin shell around one function of the library."""
