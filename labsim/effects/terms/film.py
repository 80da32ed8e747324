"""A thin layer that pushes the tip back, or lets it through, at one depth."""

import numpy as np

from . import Term

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


TERMS = tuple(map(_at, (0.5, 1.0, 1.5, 2.0, 3.0)))
