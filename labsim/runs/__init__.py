"""Simulated runs: each is made once, by whoever is free, and kept in a store under a key of all it depends on."""
