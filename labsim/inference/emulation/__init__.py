"""Runs at nodes of speed, p_m and amplitudes, and what lies between them."""
