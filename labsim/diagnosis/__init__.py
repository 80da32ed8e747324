"""What the simulation gets wrong: predictions against what was measured, causes, gain."""
