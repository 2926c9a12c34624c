"""The demo: the whole way from a dense capture to scores of an unseen plot, on small simulated plots."""
