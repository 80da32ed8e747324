"""Forces that go with the depth of the tip."""

import numpy as np

from . import Term

PLACE = "force of depth"
TERMS = (
    Term(
        "constant_pressure", "a pressure alike at all depths", PLACE, "Pa", "1",
        lambda z: np.ones_like(z), "Cohesion, a yield stress: Uehara et al. (2003)",
    ),
    Term(
        "depth_spring", "a pressure that grows with the depth", PLACE, "Pa", "z/a",
        lambda z: z, "Friction under the weight of the dust: Katsuragi & Durian (2007)",
    ),
    Term(
        "depth_square", "a pressure that grows with the square of the depth", PLACE, "Pa", "(z/a)²",
        lambda z: z**2, "A shaft whose friction grows with depth; mass that grows",
    ),
    Term(
        "surface_layer", "a pressure near the surface", PLACE, "Pa", "exp(−2 z/a)",
        lambda z: np.exp(-2.0 * z), "A crust that gives way, half a tip radius deep",
    ),
    Term(
        "deep_resistance", "a pressure that begins two tip radii deep", PLACE, "Pa", "(z/a − 2), where that is positive",
        lambda z: np.maximum(z - 2.0, 0.0), "A floor that is felt, a denser layer below",
    ),
)  # fmt: skip
