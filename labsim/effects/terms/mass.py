"""Dust that sticks to the tip and moves with it, so that the projectile grows heavier on its way.

It has the tip's speed when it sticks, since the tip has pushed it that fast. The coefficient is a share of the projectile's own
mass.
"""

import numpy as np

from . import Term

PLACE = "mass of depth"
TERMS = (
    Term(
        "stuck_mass", "dust that sticks to the tip, more with every depth", PLACE, "1", "z/a",
        lambda z: z, "Added mass of dense grains ahead: Aguilar & Goldman (2016)",
    ),
    Term(
        "stuck_cap", "a cap of dust that sticks to the tip in its first radius", PLACE, "1", "z/a, at most 1",
        lambda z: np.minimum(z, 1.0), "The cone of dense grains under a blunt tip: Aguilar & Goldman (2016)",
    ),
    Term(
        "stuck_root", "dust that sticks to the tip, most of it early", PLACE, "1", "√(z/a)",
        lambda z: np.sqrt(z), "A cone of dense grains that is nearly whole after a radius: Aguilar & Goldman (2016)",
    ),
    Term(
        "stuck_late", "dust that sticks to the tip, ever more with depth", PLACE, "1", "(z/a)²",
        lambda z: z**2, "A cone of dense grains that widens as it grows",
    ),
)  # fmt: skip
