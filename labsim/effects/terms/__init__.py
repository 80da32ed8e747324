"""Terms: what one-parameter formulas may add to the equations of motion, one file a family, found by listing this folder.

A file has ``TERMS``. Where they act: labsim/effects/law_places.py. A law is some terms with their coefficients, or tables at
knots; ``labsim diagnose`` learns one where no listed cause explains the data, a model.toml holds it.
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
from ..contract import Instrument, Place
from ..law_places import LAW_PLACES, Knots, LawPlace

FASTEST = 1.3  # of the impact speed, that a force of speed is tabulated to
KNOTS, CLOSE = 97, 33


@dataclass(frozen=True)
class Term:
    """One formula with one coefficient c.

    place : a name of LAW_PLACES; unit : of c; formula : c times what, in plain signs; shape : (n,) compaction φ - φ0, or what
    the law goes with -> (n,), in value unit per unit of c; source : where it is met; at : where it is large, if only there.
    """

    name: str
    title: str
    place: str
    unit: str
    formula: str
    shape: Callable[[FloatArray], FloatArray]
    source: str
    at: float | None = None

    @property
    def acts(self) -> LawPlace:
        return LAW_PLACES[self.place]

    def sample(self, begin: float, end: float) -> FloatArray:
        """Places from begin to end that show its shape; close to where it is large, if only there."""
        places = np.linspace(begin, end, KNOTS)
        if self.at is not None:
            near = np.linspace(0.0, 2.0, CLOSE) * self.at
            places = np.union1d(places, near[(near > begin) & (near < end)])
        return places

    @property
    def limits(self) -> tuple[float, float]:
        """Of c: no force along the motion, for that gains energy on a closed way, no mass below nought, none that is gathered and
        grows less, which would push along the motion, and no strength below what a law must leave, as far as drops come. A force
        of depth does no work on a closed way and may have either sign."""
        least = self.acts.least
        if self.acts.see:
            return least, self.acts.most
        if least == -math.inf:
            return -math.inf, math.inf
        values = self.shape(self.sample(0.0, self.acts.reach))
        highest, lowest = float(values.max()), float(values.min())
        low = least / highest if highest > 0 else -math.inf
        high = least / lowest if lowest < 0 else math.inf
        if self.acts.rising:
            low = 0.0 if (np.diff(values) > 0).any() else low
            high = 0.0 if (np.diff(values) < 0).any() else high
        return low, high


@dataclass(frozen=True)
class Law:
    """What is added to the equations. terms : name and coefficient; tables : place and knots, the filling factor itself, tip
    radii, m/s or mm against the value."""

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
        add = LAW_PLACES[place].add
        assert add is not None  # model.toml has no table of the others
        setting = add(setting, table)
    for name, coefficient in law.terms:
        setting = add_term(setting, list_terms()[name], coefficient)
    return setting


def add_term(setting: DropSetting, term: Term, coefficient: float) -> DropSetting:
    """The drop with one term; with a coefficient of nought, or one of the camera, it is the setting itself."""
    add = term.acts.add
    if coefficient == 0.0 or add is None:
        return setting
    begin, end = 0.0, term.acts.reach
    if term.acts.over == "filling factor":
        begin = setting.filling_factor
        end = setting.material.phi_2 - begin
    elif term.acts.over == "speed":
        end = FASTEST * setting.impact_speed
    elif term.acts.unit == "mm" and term.acts.simulated:
        end = min(end, 1e3 * setting.extent[1])
    elif term.acts.over == "radius of the tip":
        radius = 1e3 * setting.projectile.tip_radius
        return add(setting, ((radius, coefficient * float(term.shape(np.array([radius]))[0])),))
    place = term.sample(0.0, end)
    value = coefficient * term.shape(place)
    return add(setting, tuple(zip((begin + place).tolist(), value.tolist(), strict=True)))


def see_term(instrument: Instrument, term: Term, coefficient: float, place: Place) -> Instrument:
    """The camera with one term, whose shape is a straight line; with one of the drop it is the camera itself."""
    see = term.acts.see
    return (
        see(instrument, coefficient * float(term.shape(np.ones(1))[0]), place.pixel_size)
        if see
        else instrument
    )
