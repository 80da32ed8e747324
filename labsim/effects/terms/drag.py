"""Forces against the motion that grow with the speed."""

import numpy as np

from . import Term

PLACE = "force of speed"
TERMS = (
    Term(
        "inertial_drag", "a drag that grows with the square of the speed", PLACE, "Pa s²/m²", "v²",
        lambda v: v**2, "Momentum given to the dust ahead: Katsuragi & Durian (2007)",
    ),
    Term(
        "viscous_drag", "a drag that grows with the speed", PLACE, "Pa s/m", "v",
        lambda v: v, "Gas in the pores, and the published F = A c v: Güttler et al. (2009b)",
    ),
    Term(
        "root_drag", "a drag that grows with the root of the speed", PLACE, "Pa (s/m)^½", "√v",
        lambda v: np.sqrt(v), "Strength that grows with a power of the rate of strain",
    ),
    Term(
        "drag_above_half", "a drag that begins at 0.5 m/s", PLACE, "Pa s/m", "(v − 0.5 m/s), where that is positive",
        lambda v: np.maximum(v - 0.5, 0.0), "A threshold of speed, as for fracture or fluidisation",
    ),
    Term(
        "cubic_drag", "a drag that grows with the cube of the speed", PLACE, "Pa s³/m³", "v³",
        lambda v: v**3, "Dust that is thrown out ahead of a fast tip",
    ),
    Term(
        "drag_above_a_quarter", "a drag that begins at 0.25 m/s", PLACE, "Pa s/m", "(v − 0.25 m/s), where that is positive",
        lambda v: np.maximum(v - 0.25, 0.0), "A threshold of speed, as for fracture or fluidisation",
    ),
    Term(
        "dynamic_friction", "a force while it moves, alike at all speeds", PLACE, "Pa", "v / (v + 0.05 m/s)",
        lambda v: v / (v + 0.05), "Coulomb friction of the tip, which rest does not know",
    ),
    Term(
        "weakening_friction", "a force that fades as it moves faster", PLACE, "Pa", "v / (v + 0.05 m/s) · exp(−v / 0.3 m/s)",
        lambda v: v / (v + 0.05) * np.exp(-v / 0.3), "Friction that weakens with speed: Dieterich (1979)",
    ),
)  # fmt: skip
