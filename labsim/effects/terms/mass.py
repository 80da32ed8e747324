"""Dust that moves with the tip, so that the projectile grows heavier on its way.

What sticks has the tip's speed when it does, since the tip has pushed it that fast. What is gathered lies still until then, and
the tip gives it its momentum. The coefficient is a share of the projectile's own mass.
"""

import numpy as np

from . import Term

PLACE, STILL = "mass of depth", "gathered mass of depth"
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
    Term(
        "gathered_mass", "dust that lies still and is gathered, more with every depth", STILL, "1", "z/a",
        lambda z: z, "Momentum that grains at rest take up: Katsuragi & Durian (2007)",
    ),
    Term(
        "gathered_cap", "dust that lies still and is gathered in the tip's first radius", STILL, "1", "z/a, at most 1",
        lambda z: np.minimum(z, 1.0), "Momentum that grains at rest take up: Katsuragi & Durian (2007)",
    ),
)  # fmt: skip
