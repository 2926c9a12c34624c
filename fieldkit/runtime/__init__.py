"""Cores, memory, threads, worker processes, compiled kernels; and progress."""
