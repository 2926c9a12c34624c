"""What is measured, behind `fieldkit benchmark`; used by the command line only."""
