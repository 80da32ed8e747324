"""A thin layer that pushes the tip back, or lets it through, at one depth: over the tip's radius, or in mm."""

import numpy as np

from . import Term
from .layers import COARSE, FINE, bell, below, list_terms_at
from .layers import WIDTH as SHARE

WIDTH = 0.35  # tip radii, half of where it is felt to exp(-½)


def _at(depth: float) -> Term:
    def shape(z: np.ndarray) -> np.ndarray:
        return np.exp(-0.5 * ((z - depth) / WIDTH) ** 2)

    return Term(
        f"film_at_{depth:g}".replace(".", "_"),
        f"a layer {depth:g} tip radii deep",
        "force of depth",
        "Pa",
        f"exp(−½ ((z/a − {depth:g})/{WIDTH})²)",
        shape,
        "A film or a seam between two fillings of the box",
    )


IN_MM = "force of depth in mm"
TERMS = (
    *map(_at, (0.5, 1.0, 1.5, 2.0, 3.0)),
    *list_terms_at(
        FINE, "film_at", "a film {d} mm deep", f"exp(−½ ((z/{{d}} mm − 1)/{SHARE})²)", bell,
        "A film or a seam between two fillings of the box", IN_MM, "Pa",
    ),
    *list_terms_at(
        COARSE, "skin_to", "a force down to {d} mm", "1 down to {d} mm, fallen over half of that",
        lambda share: 1.0 - below(share), "A skin that tears", IN_MM, "Pa",
    ),
)  # fmt: skip
