"""How the compressive strength goes with the compaction, beside Σ(φ)."""

import numpy as np

from . import Term

PLACE = "strength of filling factor"
TERMS = (
    Term(
        "hardening", "a strength that grows with the compaction", PLACE, "1", "10 (φ − φ0)",
        lambda x: 10.0 * x, "Another slope of the compression curve",
    ),
    Term(
        "late_hardening", "a strength that grows with the square of the compaction", PLACE, "1", "100 (φ − φ0)²",
        lambda x: 100.0 * x**2, "Dust that hardens only when it is dense",
    ),
    Term(
        "first_resistance", "a strength of dust that has hardly been compacted", PLACE, "1", "exp(−(φ − φ0)/0.02)",
        lambda x: np.exp(-x / 0.02), "Bonds that break in the first compaction",
    ),
)  # fmt: skip
