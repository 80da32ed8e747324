"""Forces on the projectile that do not go with the tip's cross-section: alike for all tips, or with their circumference."""

import numpy as np

from . import Term

ALIKE, RIM = "force alike for all tips", "force on the rim"
TERMS = (
    Term(
        "pull", "a force alike for all tips, at all depths", ALIKE, "mN", "1",
        lambda z: np.ones_like(z), "A thread, a magnet, a release that drags",
    ),
    Term(
        "pull_spring", "a force alike for all tips that grows with the depth", ALIKE, "mN", "z/mm",
        lambda z: z, "A thread that is stretched",
    ),
    Term(
        "rim_pull", "a force on the tip's circumference, at all depths", RIM, "N/m", "1",
        lambda z: np.ones_like(z), "Adhesion, which goes with the radius: Johnson, Kendall & Roberts (1971)",
    ),
    Term(
        "rim_friction", "a force on the circumference that grows with the depth", RIM, "N/m", "z/mm",
        lambda z: z, "Friction all along a shaft as wide as the tip",
    ),
)  # fmt: skip
