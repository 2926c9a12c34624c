"""Mission files: each format written as bytes, and read back with limits."""
