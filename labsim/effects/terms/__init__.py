"""Terms: what one-parameter formulas may add to the equations of motion, one file a family, found by listing this folder.

    m (1 + Σ c s(z/a)) (d²z/dt² - g) = - F_dust[Σ(φ) (1 + Σ c s(φ - φ0))] - A Σ c s(z/a) - A Σ c s(v)

A is the cross-section of the tip, a its radius: a force is a pressure, so that one law holds for all sizes. A file
has ``TERMS``. A law is some terms with their coefficients, or tables at knots; ``labsim diagnose`` learns one where no
listed cause explains the data, a model.toml holds it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from ...extensions import list_modules
from ...records import FloatArray
from ...sph import DropSetting

Knots = tuple[tuple[float, float], ...]
# place -> (unit of what it goes with, unit of its values, what the values are)
PLACES = {
    "strength of filling factor": ("1", "1", "strength over what p_m gives, minus one"),
    "force of depth": ("tip radii", "Pa", "upward force over the cross-section of the tip"),
    "force of speed": ("m/s", "Pa", "force against the motion over the cross-section of the tip"),
    "mass of depth": ("tip radii", "1", "dust that moves with the tip over the projectile's mass"),
}
# what of it a drop passes: φ - φ0, nine tenths of what is compacted; tip radii; m/s
REACH = {
    "strength of filling factor": 0.15,
    "force of depth": 12.0,
    "force of speed": 2.0,
    "mass of depth": 12.0,
}
FASTEST = 1.3  # of the impact speed, that a force of speed is tabulated to
LEAST = 0.1  # of the strength that p_m gives, which a law must leave
KNOTS = 97


@dataclass(frozen=True)
class Term:
    """One formula with one coefficient c.

    place : one of PLACES; unit : of c; formula : c times what, in plain signs; shape : (n,) compaction φ - φ0, depth over tip
    radius, or speed in m/s -> (n,), in value unit per unit of c; source : where it is met.
    """

    name: str
    title: str
    place: str
    unit: str
    formula: str
    shape: Callable[[FloatArray], FloatArray]
    source: str

    @property
    def limits(self) -> tuple[float, float]:
        """Of c: no force along the motion, for that gains energy on a closed way, no mass below nought, and no strength below
        LEAST of what p_m gives as far as drops compact (REACH). A force of depth does no work on a closed way and may have
        either sign."""
        values = self.shape(np.linspace(0.0, REACH[self.place], KNOTS))
        if self.place == "force of depth":
            return -math.inf, math.inf
        least = LEAST - 1.0 if self.place == "strength of filling factor" else 0.0
        highest, lowest = float(values.max()), float(values.min())
        return (least / highest if highest > 0 else -math.inf, least / lowest if lowest < 0 else math.inf)


@dataclass(frozen=True)
class Law:
    """What is added to the equations. terms : name and coefficient; tables : place and knots, the filling factor itself, tip
    radii or m/s against the value."""

    terms: tuple[tuple[str, float], ...] = ()
    tables: tuple[tuple[str, Knots], ...] = ()


@cache
def list_terms() -> dict[str, Term]:
    """All terms by name, of this folder and of other packages (``labsim.terms``)."""
    return {
        term.name: term for module in list_modules(__name__, "labsim.terms").values() for term in module.TERMS
    }


def apply_law(setting: DropSetting, law: Law) -> DropSetting:
    """The drop with a law in its equations."""
    for place, table in law.tables:
        if place == "strength of filling factor":
            table = tuple((phi, 1.0 + more) for phi, more in table)
        setting = add_table(setting, place, table)
    for name, coefficient in law.terms:
        setting = add_term(setting, list_terms()[name], coefficient)
    return setting


def add_term(setting: DropSetting, term: Term, coefficient: float) -> DropSetting:
    """The drop with one term; with a coefficient of nought it is the setting itself."""
    if coefficient == 0.0:
        return setting
    reach = {
        "strength of filling factor": setting.material.phi_2 - setting.filling_factor,
        "force of depth": REACH["force of depth"],
        "force of speed": FASTEST * setting.impact_speed,
        "mass of depth": REACH["mass of depth"],
    }[term.place]
    place = np.linspace(0.0, reach, KNOTS)
    value = coefficient * term.shape(place)
    if term.place == "strength of filling factor":
        place, value = setting.filling_factor + place, np.maximum(1.0 + value, LEAST)
    return add_table(setting, term.place, tuple(zip(place.tolist(), value.tolist(), strict=True)))


def add_table(setting: DropSetting, place: str, table: Knots) -> DropSetting:
    """The drop with a law at knots, linear between and constant beyond, beside those that it has: forces add up, factors on the
    strength multiply. table : filling factor and factor, tip radii and Pa, m/s and Pa, or tip radii and share of the mass."""
    if place == "strength of filling factor":
        return setting.replace(strength_shape=combine(setting.strength_shape, table, product=True))
    radius = setting.projectile.tip_radius
    area = 2 * radius if setting.geometry == "planar" else math.pi * radius**2
    if place == "force of depth":
        table = tuple((knot * radius, value * area) for knot, value in table)
        return setting.replace(force_of_depth=combine(setting.force_of_depth, table))
    if place == "mass of depth":
        table = tuple((knot * radius, value * setting.projectile.mass) for knot, value in table)
        return setting.replace(mass_of_depth=combine(setting.mass_of_depth, table))
    table = tuple((knot, value * area) for knot, value in table)
    return setting.replace(force_of_speed=combine(setting.force_of_speed, table))


def combine(before: Knots, table: Knots, *, product: bool = False) -> Knots:
    """Sum of two laws linear between knots, or their product at the knots of both."""
    if not before:
        return table
    places = sorted({x for x, _ in (*before, *table)})
    first, second = (np.interp(places, *np.asarray(each).T) for each in (before, table))
    return tuple(zip(places, (first * second if product else first + second).tolist(), strict=True))
