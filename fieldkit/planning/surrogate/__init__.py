"""Models of the objective learnt from few evaluations: Gaussian processes, and the paper's ensemble of them."""
