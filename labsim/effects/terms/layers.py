"""Layers of the sample: dust that is stronger or weaker at a depth in mm, whatever the tip.

Depths are the preferred numbers of ISO 3, from 0.1 to 80 mm; those that a campaign's drops reach are tried.
"""

from collections.abc import Callable

import numpy as np

from ...records import FloatArray
from . import Term

PLACE = "strength of depth"
WIDTH = 0.25  # of its depth, half of what a layer is thick to exp(-½)
R10 = (1.0, 1.25, 1.6, 2.0, 2.5, 3.15, 4.0, 5.0, 6.3, 8.0)
FINE = tuple(float(f"{each * decade:g}") for decade in (0.1, 1.0, 10.0) for each in R10)
COARSE = FINE[::3]


def list_terms_at(
    depths: tuple[float, ...],
    name: str,
    title: str,
    formula: str,
    shape: Callable[[FloatArray], FloatArray],
    source: str,
    place: str = PLACE,
    unit: str = "1",
) -> tuple[Term, ...]:
    """One term a depth d in mm. shape : of the depth over d; {d} in texts stands for d."""

    def make(d: float) -> Term:
        said, formed = (each.format(d=f"{d:g}") for each in (title, formula))
        key = f"{name}_{d:g}_mm".replace(".", "_")
        return Term(key, said, place, unit, formed, lambda z: shape(z / d), source, at=d)

    return tuple(map(make, depths))


def bell(share: FloatArray) -> FloatArray:
    return np.exp(-0.5 * ((share - 1.0) / WIDTH) ** 2)


def below(share: FloatArray) -> FloatArray:
    return 0.5 + 0.5 * np.tanh((share - 1.0) / WIDTH)


TERMS = (
    *list_terms_at(
        FINE, "layer_at", "a layer {d} mm deep", f"exp(−½ ((z/{{d}} mm − 1)/{WIDTH})²)", bell,
        "A seam between two fillings of the box, a layer that dried",
    ),
    *list_terms_at(
        COARSE, "strength_below", "dust of another strength below {d} mm", "1 from {d} mm on, grown over half of that", below,
        "A box filled twice",
    ),
    *list_terms_at(
        COARSE, "crust_of", "a crust {d} mm thick", "exp(−z/{d} mm)", lambda share: np.exp(-share),
        "A surface that was pressed, wetted or baked",
    ),
    Term(
        "strength_gradient", "a strength that grows with the depth", PLACE, "1", "z/mm",
        lambda z: z, "Dust that was consolidated by its own weight",
    ),
)  # fmt: skip
