"""What no listed cause explains: its evidence, the free law it would be, and a formula for that."""
