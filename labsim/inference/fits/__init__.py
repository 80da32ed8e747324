"""Fits of one hypothesis: the linearised problem, its steps, evidence, and the posterior about the best point."""
