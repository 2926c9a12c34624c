"""What a process runs on: cores, memory, threads, worker processes, compiled kernels; and what it tells meanwhile."""
