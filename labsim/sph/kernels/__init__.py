"""The compiled loops of the solver: arrays and numbers in, arrays changed. One time step is in ``advance``."""
