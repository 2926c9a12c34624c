"""Whether this machine can run fieldkit."""
