"""Dust that sticks to the tip and moves with it, so that the projectile grows heavier on its way.

It has the tip's speed when it sticks, since the tip has pushed it that fast. Dust that is picked up at rest slows the projectile
besides: that is an ``inertial_drag`` with the same coefficient.
"""

import numpy as np

from . import Term

PLACE = "mass of depth"
TERMS = (
    Term(
        "stuck_mass", "dust that sticks to the tip, more with every depth", PLACE, "kg/m³", "z/a",
        lambda z: z, "Added mass of dense grains ahead: Aguilar & Goldman (2016)",
    ),
    Term(
        "stuck_cap", "a cap of dust that sticks to the tip in its first radius", PLACE, "kg/m³", "z/a, at most 1",
        lambda z: np.minimum(z, 1.0), "The cone of dense grains under a blunt tip: Aguilar & Goldman (2016)",
    ),
)  # fmt: skip
