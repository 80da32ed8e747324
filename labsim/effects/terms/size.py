"""How the strength goes with the radius of the tip. Needs tips of two radii."""

import numpy as np

from . import Term

PLACE = "strength of size"
TERMS = (
    Term(
        "size_power", "a strength that goes with a power of the tip's radius", PLACE, "1", "ln(a / 1 mm)",
        lambda a: np.log(a), "Size effect of indentation; grains that are not small beside the tip: Bažant (1984)",
    ),
    Term(
        "size_curvature", "a strength that goes with the tip's curvature", PLACE, "1", "1 mm / a",
        lambda a: 1.0 / a, "A layer of fixed thickness about the tip: Nix & Gao (1998)",
    ),
)  # fmt: skip
