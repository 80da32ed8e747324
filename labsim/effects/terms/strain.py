"""How strengths go with the plastic shear strain: what shear breaks, or jams, in the dust.

ε is the sum of the plastic strain over the way of a piece of dust, however it is sheared back and forth. Under a tip it comes to
about one.
"""

import numpy as np

from . import Term

PLACE, SHEAR = "strength of plastic strain", "shear strength of plastic strain"
TERMS = (
    Term(
        "shear_damage", "a strength that shear takes, half of it by a strain of 0.2", PLACE, "1", "1 − exp(−ε/0.3)",
        lambda x: 1.0 - np.exp(-x / 0.3), "Bonds that shear breaks: remoulding, Einav & Randolph (2005)",
    ),
    Term(
        "slow_shear_damage", "a strength that shear takes, half of it by a strain of 0.7", PLACE, "1", "1 − exp(−ε)",
        lambda x: 1.0 - np.exp(-x), "Bonds that shear breaks: remoulding, Einav & Randolph (2005)",
    ),
    Term(
        "strain_hardening", "a strength that grows with the plastic strain", PLACE, "1", "ε",
        lambda x: x, "Linear isotropic hardening: Simo & Hughes (1998)",
    ),
    Term(
        "shear_softening", "a shear strength that shear takes, half of it by a strain of 0.2", SHEAR, "1", "1 − exp(−ε/0.3)",
        lambda x: 1.0 - np.exp(-x / 0.3), "From peak to residual friction: Schofield & Wroth (1968)",
    ),
    Term(
        "shear_hardening", "a shear strength that grows with the plastic strain", SHEAR, "1", "ε",
        lambda x: x, "Linear isotropic hardening: Simo & Hughes (1998)",
    ),
    Term(
        "shear_power_hardening", "a shear strength that grows with the root of the plastic strain", SHEAR, "1", "√ε",
        lambda x: np.sqrt(x), "A power law of hardening: Hollomon (1945)",
    ),
)  # fmt: skip
