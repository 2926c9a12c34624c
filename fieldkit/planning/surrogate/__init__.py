"""What is learnt of the objective from few evaluations: Gaussian processes, one per kernel, and their ensemble."""
