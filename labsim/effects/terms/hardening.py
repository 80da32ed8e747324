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
    Term(
        "early_hardening", "a strength that grows with the root of the compaction", PLACE, "1", "√(10 (φ − φ0))",
        lambda x: np.sqrt(10.0 * x), "Bonds that form as soon as grains rearrange",
    ),
    Term(
        "hardening_above_5", "a strength that grows from 0.05 of compaction on", PLACE, "1",
        "10 (φ − φ0 − 0.05), where that is positive", lambda x: 10.0 * np.maximum(x - 0.05, 0.0),
        "A second branch of the compression curve",
    ),
    Term(
        "lasting_resistance", "a strength that fades over 0.06 of compaction", PLACE, "1", "exp(−(φ − φ0)/0.06)",
        lambda x: np.exp(-x / 0.06), "A structure that is lost slowly",
    ),
    Term(
        "hardening_bump", "a strength about 0.05 of compaction", PLACE, "1", "exp(−½ ((φ − φ0 − 0.05)/0.02)²)",
        lambda x: np.exp(-0.5 * ((x - 0.05) / 0.02) ** 2), "A step of the compression curve, as of aggregates in aggregates",
    ),
)  # fmt: skip
