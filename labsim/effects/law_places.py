"""Where the equations, or the clock of a camera, have a place for a law that is not in them, one record each.

    m (1 + d(z/a) + k(z/a)) (d²z/dt² - g) = - F_dust[Σ(φ) (1 + e(φ)) (1 + g(ε)) (1 + l(z0)) (1 + r(t)) exp(f(a)), Y (1 + h(ε))]
                                           - A (b(z/a) + s(z)) - p(z) - 2π a q(z)
                                           - A (c(v) + j(t) + v n(z/a) + v² o(z/a)) - m k'(z/a) v²/a

m is the mass of the projectile, A the cross-section of its tip, a its radius; ε the plastic shear strain of the dust, z0 where it
lay, t the time since contact. Most forces are pressures, so that one law holds for all sizes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..calibrated import read_value, set_value
from ..sph import DropSetting
from .contract import Instrument

Knots = tuple[tuple[float, float], ...]
MOST_DELAY = 0.6  # s/m: a tip of 1 m/s must not outrun the rows
# parts of the equation: what is added to the mass, factors on two strengths, forces, and what a letter in these stands for
MASS, SIGMA, SHEAR, FORCE, WHERE = "mass", "Σ", "Y", "force", "where"
LEAST = 0.1  # of the strength that p_m gives, which a law must leave
# of the deepest drop: a layer is felt by its share of the way
IN_MM = (0.0, 0.04, 0.063, 0.1, 0.16, 0.25, 0.4, 0.63, 1.0)


@dataclass(frozen=True)
class LawPlace:
    """over, unit : what a law goes with there; value_unit : of what it gives; words : that in front of a formula.

    shown, shown_unit : that at an axis. reach : of what it goes with, as far as drops come. least : smallest value, a smaller one
    ``breaks`` physics; of a camera's, and most, ends of its coefficients; rising : whether falling values do, too. scale : a
    usual value. knots : of what it goes with, in shares of the deepest drop where that is mm, for a law without a formula; none
    where no runs say what it changes. enters : the parts of the equation above that a law stands in, and how, {} for the law.
    add : to a drop, a table of knots; see : to a camera, a coefficient at a size of its pixels (m).
    """

    name: str
    over: str
    unit: str
    value_unit: str
    words: str
    shown: str
    shown_unit: str
    reach: float
    least: float
    breaks: str
    scale: float
    knots: tuple[float, ...]
    enters: tuple[tuple[str, str], ...]
    add: Callable[[DropSetting, Knots], DropSetting] | None
    see: Callable[[Instrument, float, float], Instrument] | None = None
    most: float = math.inf
    rising: bool = False

    @property
    def simulated(self) -> bool:
        """Whether runs say what a law changes there."""
        return bool(self.knots)

    @property
    def key(self) -> str:
        """In the table [law] of a model.toml."""
        return self.name.replace(" ", "_")

    @property
    def axes(self) -> tuple[str, str]:
        """What a curve is drawn against, and what it shows."""
        return _label(self.over, self.unit), _label(self.shown, self.shown_unit)

    @property
    def factor(self) -> float:
        """Of values as they are shown."""
        return 100.0 if self.shown_unit == "%" else 1.0


def _label(words: str, unit: str) -> str:
    return words if unit == "1" else f"{words} ({unit})"


def _add_share(key: str, unit: float = 1.0) -> Callable[[DropSetting, Knots], DropSetting]:
    """What adds a share, over the first column of a table in this unit, to a strength: by the factors that the setting's key
    holds."""

    def add(setting: DropSetting, table: Knots) -> DropSetting:
        factors = tuple((place * unit, max(1.0 + more, LEAST)) for place, more in table)
        return setting.replace(**{key: combine(getattr(setting, key), factors, product=True)})

    return add


def _add_force(
    key: str, unit: float | None, pressure: Callable[[float], float] = lambda radius: 1.0
) -> Callable[[DropSetting, Knots], DropSetting]:
    """What adds a force to the table that the setting's key holds. unit : of what the table goes with, None for the tip's radius;
    pressure : on the cross-section that one unit of the force is, of the tip's radius in m."""

    def add(setting: DropSetting, table: Knots) -> DropSetting:
        radius = setting.projectile.tip_radius
        force, length = pressure(radius) * _section(setting), unit or radius
        table = tuple((knot * length, value * force) for knot, value in table)
        return setting.replace(**{key: combine(getattr(setting, key), table)})

    return add


def _add_mass(key: str) -> Callable[[DropSetting, Knots], DropSetting]:
    """What adds a share of the projectile's mass, over depth in tip radii, to the masses that the setting's key holds."""

    def add(setting: DropSetting, table: Knots) -> DropSetting:
        radius, mass = setting.projectile.tip_radius, setting.projectile.mass
        table = tuple((knot * radius, value * mass) for knot, value in table)
        return setting.replace(**{key: combine(getattr(setting, key), table)})

    return add


def _add_size(setting: DropSetting, table: Knots) -> DropSetting:
    more = float(np.interp(1e3 * setting.projectile.tip_radius, *np.asarray(table).T))
    strength = read_value(setting.material) * math.exp(more)
    return setting.replace(material=set_value(setting.material, strength)) if more != 0.0 else setting


def _delay_rows(camera: Instrument, value: float, pixel_size: float) -> Instrument:
    """value : µs from one row to the next."""
    delay = min(max(1e-6 * value / pixel_size, -MOST_DELAY), MOST_DELAY)
    return camera.replace(row_delay=camera.row_delay + delay)


def _section(setting: DropSetting) -> float:
    radius = setting.projectile.tip_radius
    return 2 * radius if setting.geometry == "planar" else math.pi * radius**2


def combine(before: Knots, table: Knots, *, product: bool = False) -> Knots:
    """Sum of two laws linear between knots, or their product at the knots of both."""
    if not before:
        return table
    places = sorted({x for x, _ in (*before, *table)})
    first, second = (np.interp(places, *np.asarray(each).T) for each in (before, table))
    return tuple(zip(places, (first * second if product else first + second).tolist(), strict=True))


# 400 Pa stop a drop of 0.65 m/s by the published 625 Pa s/m. Half of what a tip compacts ends below 0.03 above φ0, nine tenths
# below 0.07. A mass that goes up and down again would be any force of depth: it has few knots
LAW_PLACES = {
    place.name: place
    for place in (
        LawPlace(
            "strength of filling factor", "filling factor", "1", "1",
            "a compressive strength that is more than p_m gives by a share of", "more strength", "%",
            0.15, LEAST - 1.0, "leaves no strength", 1.0, (0.0, 0.03, 0.07, 0.13),
            ((SIGMA, "(1 + {})"),), _add_share("strength_shape"),
        ),
        LawPlace(
            "strength of plastic strain", "plastic shear strain", "1", "1",
            "a compressive strength, and the shear strength with it, that is more by a share of", "more strength", "%",
            2.0, LEAST - 1.0, "leaves no strength", 1.0, (0.0, 0.15, 0.6),
            ((SIGMA, "(1 + {})"),), _add_share("strength_of_strain"),
        ),
        LawPlace(
            "shear strength of plastic strain", "plastic shear strain", "1", "1",
            "a shear strength that is more by a share of", "more shear strength", "%",
            2.0, LEAST - 1.0, "leaves no strength", 1.0, (0.0, 0.15, 0.6),
            ((SHEAR, "(1 + {})"),), _add_share("shear_of_strain"),
        ),
        LawPlace(
            "force of depth", "depth", "tip radii", "Pa",
            "a force upwards on the tip, over its cross-section, of", "force upwards", "Pa",
            12.0, -math.inf, "", 400.0, (0.0, 0.5, 1.0, 2.0, 4.0),
            ((FORCE, "A {}"),), _add_force("force_of_depth", None),
        ),
        LawPlace(
            "force of depth in mm", "depth", "mm", "Pa",
            "a force upwards on the tip, over its cross-section, of", "force upwards", "Pa",
            100.0, -math.inf, "", 400.0, IN_MM,
            ((FORCE, "A {}"),), _add_force("force_of_depth", 1e-3),
        ),
        LawPlace(
            "force alike for all tips", "depth", "mm", "mN",
            "a force upwards, alike for all tips, of", "force upwards", "mN",
            100.0, -math.inf, "", 0.3, (0.0, 1.0),
            ((FORCE, "{}"),), _add_force("force_of_depth", 1e-3, lambda a: 1e-3 / (math.pi * a**2)),
        ),
        LawPlace(
            "force on the rim", "depth", "mm", "N/m",
            "a force upwards on the tip, over its circumference, of", "force upwards", "N/m",
            100.0, -math.inf, "", 0.1, (0.0, 1.0),
            ((FORCE, "2π a {}"),), _add_force("force_of_depth", 1e-3, lambda a: 2.0 / a),
        ),
        LawPlace(
            "strength of depth", "depth where dust lay", "mm", "1",
            "a compressive strength of the dust where it lay that is more by a share of", "more strength", "%",
            100.0, LEAST - 1.0, "leaves no strength", 1.0, IN_MM,
            ((SIGMA, "(1 + {})"),), _add_share("strength_of_depth", 1e-3),
        ),
        LawPlace(
            "strength of time", "time since contact", "ms", "1",
            "a compressive strength, and the shear strength with it, that is more by a share of", "more strength", "%",
            12.0, LEAST - 1.0, "leaves no strength", 1.0, (0.0, 1.0, 2.0, 4.0),
            ((SIGMA, "(1 + {})"),), _add_share("strength_of_time", 1e-3),
        ),
        LawPlace(
            "force of speed", "speed", "m/s", "Pa",
            "a force against the motion, over the tip's cross-section, of", "force against the motion", "Pa",
            2.0, 0.0, "pushes along the motion", 400.0, (0.0, 0.1, 0.3, 0.6, 1.2),
            ((FORCE, "A {}"),), _add_force("force_of_speed", 1.0),
        ),
        LawPlace(
            "viscosity of depth", "depth", "tip radii", "Pa s/m",
            "a force against the motion, over the tip's cross-section, that is its speed times", "force over speed", "Pa s/m",
            12.0, 0.0, "pushes along the motion", 400.0, (0.0, 1.0, 4.0),
            ((FORCE, "A v {}"),), _add_force("viscosity_of_depth", None),
        ),
        LawPlace(
            "drag of depth", "depth", "tip radii", "Pa s²/m²",
            "a force against the motion, over the tip's cross-section, that is the square of its speed times",
            "force over the square of the speed", "Pa s²/m²",
            12.0, 0.0, "pushes along the motion", 600.0, (0.0, 1.0, 4.0),
            ((FORCE, "A v² {}"),), _add_force("drag_of_depth", None),
        ),
        LawPlace(
            "force of time", "time since contact", "ms", "Pa",
            "a force against the motion, over the tip's cross-section, of", "force against the motion", "Pa",
            30.0, 0.0, "pushes along the motion", 400.0, (0.0, 1.0, 2.0, 4.0),
            ((FORCE, "A {}"),), _add_force("force_of_time", 1e-3),
        ),
        LawPlace(
            "mass of depth", "depth", "tip radii", "1",
            "dust that moves with the tip, over the mass of the projectile, of", "mass that sticks", "%",
            12.0, 0.0, "takes mass away", 0.3, (0.0, 1.0, 4.0),
            ((MASS, "{}"),), _add_mass("mass_of_depth"),
        ),
        LawPlace(
            "gathered mass of depth", "depth", "tip radii", "1",
            "dust that lies still until the tip takes it along, over the mass of the projectile, of", "mass that is gathered",
            "%", 12.0, 0.0, "takes mass away", 0.3, (0.0, 1.0, 4.0),
            ((MASS, "k"), (FORCE, "m k′ v²/a"), (WHERE, "k = {}")), _add_mass("gathered_of_depth"), rising=True,
        ),
        LawPlace(
            "strength of size", "radius of the tip", "mm", "1",
            "a strength whose logarithm differs from that of p_m by", "ln strength", "1",
            5.0, -math.inf, "", 0.3, (),
            ((SIGMA, "exp({})"),), _add_size,
        ),
        LawPlace(
            "clock of row", "row of the picture", "px", "µs",
            "a camera that exposes the tip later by", "later", "µs",
            1000.0, -100.0, "", 6.0, (), (), None, most=100.0, see=_delay_rows,
        ),
        LawPlace(
            "clock of time", "time", "s", "1",
            "a camera whose time between frames grows by", "longer", "1",
            0.1, -30.0, "", 10.0, (), (), None, most=30.0,  # in 30 ms the rate must not turn around
            see=lambda camera, value, _: camera.replace(clock_drift=camera.clock_drift + value),
        ),
    )
}  # fmt: skip
