"""From photographs and what is known of their poses to posed photographs and sparse points."""
