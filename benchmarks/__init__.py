"""The benchmarks: `python -m benchmarks`. The package does not use them."""
