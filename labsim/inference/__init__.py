"""Runs, emulator, likelihood, calibration: from simulations and measurements to a posterior of p_m."""
