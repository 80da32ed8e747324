"""Campaigns whose truth is known, by labsim's own solver, and how strong what is hidden in them is."""
