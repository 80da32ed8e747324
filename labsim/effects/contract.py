"""What an effect is: the records that its file is made of and is called with.

An effect is a file with module-level names (docs/effects-writing.md has them in a table): title, kind, parameters, leaves,
references, expect, says, needs, remedy, without, applies(campaign) and at least one of change_setting(setting, values, place) and
change_instrument(instrument, values, place). Every effect is a nested extension of the nominal model: at the null of its
parameters it changes nothing, bit for bit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np

from ..calibrated import read_value, set_value
from ..errors import EffectError
from ..records import (
    STANDARD_GRAVITY,
    Campaign,
    FloatArray,
    Material,
    Projectile,
    PublishedScan,
    Sample,
    Scan,
)
from ..sph import DropSetting
from .priors import Cauchy, HalfNormal, LogNormal, Normal, Prior, Uniform

Kind = Literal["material", "sample", "contact", "projectile", "measurement", "numerics"]
KINDS: tuple[Kind, ...] = ("material", "sample", "contact", "projectile", "measurement", "numerics")
OBSERVABLES = ("penetration_depth", "stopping_time", "compacted_volume")
TANGENT = 0.05  # of a parameter's step, by its grade, that tangents are taken over


@dataclass(frozen=True)
class Parameter:
    """One number of an effect, in the unit that is reported.

    null: the value that switches the effect off (for ``shape`` parameters, which do not matter at the null of the others:
    the value taken where nothing else is said). step: for tangents, towards the natural side. prior: its reason stands
    in ``text``. symbol: as it is printed. doubles: the amplitude at which what it acts on is twice what it is at null, of an
    amplitude that acts in proportion and may be many times that. fades: the change of the amplitude that makes what it does e
    times as large, of one that does nothing until it is far from null.
    """

    name: str
    unit: str
    null: float
    limits: tuple[float, float]
    prior: Prior
    step: float
    text: str
    shape: bool = False
    symbol: str = ""
    doubles: float = math.inf
    fades: float = math.inf

    def log_prior(self, value: FloatArray | float) -> np.ndarray:
        """ln of the prior density cut off at the limits, -inf outside; integrates to one between them."""
        low, high = self.limits
        inside = float(self.prior.cdf(high) - self.prior.cdf(low))
        value = np.asarray(value, dtype=float)
        density = self.prior.logpdf(value) - math.log(inside)
        return np.where((value >= low) & (value <= high), density, -np.inf)

    def hold(self, amplitude: float) -> float:
        """null plus an amplitude, kept inside the limits: null plus what is left to a limit may round beyond it."""
        low, high = self.limits
        return min(max(self.null + amplitude, low), high)

    @cached_property
    def is_ratio(self) -> bool:
        """Whether the parameter counts by its ratio to null: it is positive by its prior, and null is no zero."""
        return isinstance(self.prior, LogNormal) and self.null > 0.0

    def grade(self, amplitude: float) -> float:
        """Where an amplitude lies on the scale on which what it does is smooth: ln of the ratio to null of what counts by that,
        of the factor of what doubles, e to the amplitude over ``fades``, less 1, the amplitude itself of all else. A factor of
        0.1 is as far from 0.2 as 0.5 from 1."""
        if math.isfinite(self.fades):
            return math.copysign(self.fades * math.expm1(abs(amplitude) / self.fades), amplitude)
        whole = self._whole
        return whole[1] * math.log1p(amplitude / whole[0]) if whole else amplitude

    def amplitude_at(self, grade: float) -> float:
        """The amplitude at a grade."""
        if math.isfinite(self.fades):
            return math.copysign(self.fades * math.log1p(abs(grade) / self.fades), grade)
        whole = self._whole
        return whole[0] * math.expm1(grade / whole[1]) if whole else grade

    def difference(self, amplitude: float) -> float:
        """By how much an amplitude is changed for a tangent there: by a small grade; at the null of what fades to nothing
        there by its whole step, for what is next to the null says nothing of what is beyond."""
        if math.isfinite(self.fades) and amplitude == 0.0:
            return self.step
        here, step = self.grade(amplitude), TANGENT * self.grade(self.step)
        low, high = self.limits
        if not low <= self.null + self.amplitude_at(here + step) <= high:
            step = -step
        return self.amplitude_at(here + step) - amplitude

    def stretch(self, times: float) -> Parameter:
        """The same parameter with a step that is ``times`` as long by its grade, kept inside the limits; a step that doubles what
        it acts on, or goes to where it begins to act, is long enough."""
        if math.isfinite(self.doubles) or math.isfinite(self.fades):
            return self
        return replace(self, step=self.hold(self.amplitude_at(times * self.grade(self.step))) - self.null)

    @cached_property
    def _whole(self) -> tuple[float, float] | None:
        """The amplitude that doubles what it acts on, and the unit of grades, where these are logarithms."""
        if self.is_ratio:
            return self.null, 1.0
        return (self.doubles, self.doubles) if math.isfinite(self.doubles) else None

    def stand_in(self, amplitude: float) -> tuple[float, float]:
        """Width of the Gaussian about null that falls as steeply as the prior at an amplitude; ln of the prior there over that at
        null. A Cauchy law falls with 2 x / (s² + x²)."""
        if isinstance(self.prior, Cauchy):
            ratio = amplitude / self.prior.sd
            return self.prior.sd * math.sqrt(0.5 * (1.0 + ratio**2)), -math.log1p(ratio**2)
        return self.scale, -0.5 * (amplitude / self.scale) ** 2

    def draw(self, rng: np.random.Generator) -> float:
        """A value from the prior between the limits."""
        below, above = (float(self.prior.cdf(limit)) for limit in self.limits)
        value = float(self.prior.ppf(rng.uniform(below, above)))
        return min(max(value, self.limits[0]), self.limits[1])

    @cached_property
    def scale(self) -> float:
        """How far from null the prior expects the value (root mean square; of a Cauchy law, that has none, its half width): the
        unit of dimensionless amplitudes."""
        if isinstance(self.prior, Cauchy):
            return self.prior.sd
        low, high = (float(self.prior.cdf(limit)) for limit in self.limits)
        quantiles = low + (high - low) * (np.arange(400) + 0.5) / 400
        return float(np.sqrt(np.mean((self.prior.ppf(quantiles) - self.null) ** 2)))


@dataclass(frozen=True)
class Place:
    """One drop or scan of a campaign, as far as an effect may depend on it.

    sequence_fraction: -0.5 for the first drop made, +0.5 for the last, 0 for scans. sample and nominal are what the
    campaign states; p_m stays in ``setting.material``. tip: of the stated projectile.
    smallest_tip_radius: of the campaign's drops, m. position: east and north of the middle of all drops, m. pixel_size: m.
    """

    name: str
    sequence_fraction: float
    is_scan: bool
    sample: Sample
    nominal: Material
    tip: str = "hemisphere"
    smallest_tip_radius: float = 0.5e-3
    position: tuple[float, float] | None = None
    pixel_size: float = 1e-5


@dataclass(frozen=True)
class Instrument:
    """What the measurement is, relative to what is stated of it; at these defaults all statements are true."""

    pixel_factor: float = 1.0  # true over stated pixel size
    rate_factor: float = 1.0  # true over stated frame rate
    row_offset_px: float = 0.0  # true minus stated row of the surface, px
    row_delay: float = (
        0.0  # s/m, by which a lower point is exposed later, where rows are read one after another
    )
    clock_drift: float = 0.0  # 1/s, share by which the time between frames grows in a second from contact on
    ct_scale: float = 1.0  # true over stated grey level per density
    ct_blur: float = 0.0  # m, by which the standard deviation of the point spread is larger than assumed

    gauge_shift: float = (
        0.0  # Pa of the tip's section that a force gauge reads too much at the start of a push
    )
    gauge_time: float = 300.0  # s, over which that goes

    static_factor: float = 1.0  # static over dynamic compressive strength: a test at rest measures the former

    def replace(self, **changes: float) -> Instrument:
        return replace(self, **changes)

    def stated_time(self, time: FloatArray) -> FloatArray:
        """Time (s) that the stated frame rate gives to an instant of true time (s)."""
        return np.asarray(time) * self.rate_factor

    def true_time(self, time: FloatArray) -> FloatArray:
        """True time (s) of an instant to which the stated frame rate gives this one (s)."""
        return np.asarray(time) / self.rate_factor

    def stated_depth(self, depth: FloatArray, pixel_size: float) -> FloatArray:
        """Depth (m) that the stated pixel size (m) and surface row give to a true depth (m)."""
        return np.asarray(depth) / self.pixel_factor + self.row_offset_px * pixel_size

    def stated_filling_factor(self, filling_factor: FloatArray) -> FloatArray:
        """Filling factor that the stated grey calibration gives, before blur."""
        return np.asarray(filling_factor) * self.ct_scale

    def stated_resistance(self, resistance: FloatArray, depth: FloatArray, speed: float) -> FloatArray:
        """Resistance (Pa) that a gauge reads at depths (m) that a push at a speed (m/s) reaches, of a true one (Pa)."""
        return np.asarray(resistance) + self.gauge_shift * np.exp(
            -np.asarray(depth) / (speed * self.gauge_time)
        )


Values = Mapping[str, float]
ChangeSetting = Callable[[DropSetting, Values, Place], DropSetting]
ChangeInstrument = Callable[[Instrument, Values, Place], Instrument]


@dataclass(frozen=True)
class Effect:
    """An effect as loaded and checked, with its parameters resolved for one campaign."""

    name: str
    title: str
    kind: Kind
    parameters: tuple[Parameter, ...]
    leaves: str
    references: tuple[str, ...]
    expect: Mapping[str, int]
    file: Path
    reason_against: Callable[[Campaign], str] = field(repr=False)
    change_setting: ChangeSetting | None = field(repr=False)
    change_instrument: ChangeInstrument | None = field(repr=False)
    resolve: Callable[[Campaign], tuple[Parameter, ...]] = field(repr=False)
    description: str = ""
    remedy: str = (
        ""  # what to do about it; {value} is its first parameter. Where it says nothing, its kind does
    )

    without: str = ""  # how a drop is made where it is not at work, as it stands after "a drop"
    says: tuple[str, str] | None = (
        None  # the title where the first parameter lies below its null, and above it
    )
    # (an amplitude, a value of the shape) -> what the amplitude is with it; the same where nothing is said
    reshape: Callable[[Parameter, float], Parameter] | None = field(default=None, repr=False)
    # (an amplitude, (n, 2) depth and tip radius of measured drops, m) -> what it is once these are known
    narrow: Callable[[Parameter, FloatArray], Parameter] | None = field(default=None, repr=False)

    def say(self, value: float) -> str:
        """What is wrong at a value of the first parameter, as a sentence without its end."""
        return self.says[value > self.amplitudes[0].null] if self.says else self.title

    def applies(self, campaign: Campaign) -> str:
        """Empty if the effect can be at work in this campaign, else the reason why not."""
        return self.reason_against(campaign)

    def for_campaign(self, campaign: Campaign) -> Effect:
        """The same effect with nulls, limits and priors of this campaign. Raises EffectError."""
        return replace(self, parameters=self.resolve(campaign))

    def for_drops(self, measured: FloatArray) -> Effect:
        """The same effect once depth and tip radius of all drops are measured, (n, 2) m."""
        if self.narrow is None or not len(measured):
            return self
        narrow = self.narrow
        return replace(
            self, parameters=tuple(each if each.shape else narrow(each, measured) for each in self.parameters)
        )

    @property
    def amplitudes(self) -> tuple[Parameter, ...]:
        """The parameters that decide whether the effect is on."""
        return tuple(parameter for parameter in self.parameters if not parameter.shape)

    def stretch(self, times: float) -> Effect:
        """The same effect with longer steps to its tangents, where runs are rough."""
        return replace(
            self, parameters=tuple(each if each.shape else each.stretch(times) for each in self.parameters)
        )

    def with_shape(self, value: float) -> Effect:
        """The effect with another default of its (first) shape parameter, and amplitudes that do as much with it."""
        chosen = next(each for each in self.parameters if each.shape)

        def change(each: Parameter) -> Parameter:
            if each is chosen:
                return replace(each, null=value)
            return each if each.shape or self.reshape is None else self.reshape(each, value)

        return replace(self, parameters=tuple(change(each) for each in self.parameters))

    @property
    def affects_simulation(self) -> bool:
        """Whether it changes the drop; otherwise only what is read off the instruments."""
        return self.change_setting is not None

    def parameter(self, name: str) -> Parameter:
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        raise EffectError(
            self.file, name, f"is not a parameter of {self.name}; use {self._names() or 'none, it has none'}"
        )

    def at(self, values: Values | None = None) -> dict[str, float]:
        """All parameters: those given, checked, and null for the others. Raises EffectError."""
        full = {parameter.name: float(parameter.null) for parameter in self.parameters}
        for name, value in (values or {}).items():
            low, high = self.parameter(name).limits
            if (
                isinstance(value, bool)
                or not isinstance(value, (int, float, np.number))
                or not math.isfinite(value)
            ):
                raise EffectError(self.file, name, f"{value!r} is not a finite number")
            if not low <= value <= high:
                raise EffectError(
                    self.file,
                    name,
                    f"{value:.6g} is outside {low:.4g} to {high:.4g} {self.parameter(name).unit}".rstrip(),
                )
            full[name] = float(value)
        return full

    def draw(self, rng: np.random.Generator) -> dict[str, float]:
        """All parameters from their priors."""
        return {parameter.name: parameter.draw(rng) for parameter in self.parameters}

    def log_prior(self, values: Values) -> float:
        full = {parameter.name: parameter.null for parameter in self.parameters} | dict(values)
        return float(sum(float(parameter.log_prior(full[parameter.name])) for parameter in self.parameters))

    def apply(self, setting: DropSetting, values: Values, place: Place) -> DropSetting:
        """The drop with this effect, or the setting itself where the effect does not touch the drop."""
        return self.change_setting(setting, self.at(values), place) if self.change_setting else setting

    def apply_to_instrument(self, instrument: Instrument, values: Values, place: Place) -> Instrument:
        return (
            self.change_instrument(instrument, self.at(values), place)
            if self.change_instrument
            else instrument
        )

    def _names(self) -> str:
        return ", ".join(parameter.name for parameter in self.parameters)


def all_pushed(campaign: Campaign) -> bool:
    """Whether nothing is dropped: a driver leads every projectile, whose mass and stop then mean nothing."""
    return all(drop.motion.kind != "free" for drop in campaign.drops)


def find_middle(campaign: Campaign) -> tuple[float, float]:
    """Mean east and north (m) of the drops whose position is stated."""
    stated = [drop.position for drop in campaign.drops if drop.position is not None]
    east, north = np.mean(stated, axis=0) if stated else (0.0, 0.0)
    return float(east), float(north)


def list_places(campaign: Campaign) -> dict[str, Place]:
    """The place of every drop and scan of a campaign, by name."""
    numbers = [drop.sequence for drop in campaign.drops]
    first, last = min(numbers), max(numbers)
    smallest = min(drop.projectile.tip_radius for drop in campaign.drops)
    places = {}
    middle = find_middle(campaign)
    for drop in campaign.drops:
        fraction = (drop.sequence - first) / (last - first) - 0.5 if last > first else 0.0
        position = None
        if drop.position is not None:
            position = drop.position[0] - middle[0], drop.position[1] - middle[1]
        places[drop.name] = Place(
            drop.name,
            fraction,
            False,
            campaign.sample,
            campaign.material,
            drop.projectile.tip,
            smallest,
            position,
            drop.camera.pixel_size if drop.camera else Place.pixel_size,
        )
    for scan in _list_scans(campaign):
        places[scan.name] = Place(
            scan.name, 0.0, True, campaign.sample, campaign.material, scan.projectile.tip, smallest
        )
    return places


def _list_scans(campaign: Campaign) -> list[Scan | PublishedScan]:
    return [*campaign.scans, *campaign.published_scans]


def list_impacts(campaign: Campaign) -> list[tuple[float, float, float]]:
    """Tip radius (m), mass (kg) and expected speed at contact (m/s) of every drop and scan, from what is stated."""
    return [(each.tip_radius, each.mass, speed) for each, speed in _list_impacts(campaign)]


def _list_impacts(campaign: Campaign) -> list[tuple[Projectile, float]]:
    impacts = []
    for drop in campaign.drops:
        speed = math.sqrt(2.0 * STANDARD_GRAVITY * drop.height.value) if drop.height else 0.0
        if drop.published and drop.published.impact_speed:
            speed = drop.published.impact_speed.value
        impacts.append((drop.projectile, speed))
    for scan in _list_scans(campaign):
        impacts.append((scan.projectile, scan.speed.value))
    return impacts


def _list_settings(campaign: Campaign, p_m: float) -> list[DropSetting]:
    """Every drop and scan as it is simulated in dust of one strength (Pa)."""
    material = set_value(campaign.material, p_m)
    return [
        DropSetting(projectile.simulated, speed, material, geometry=campaign.geometry)
        for projectile, speed in _list_impacts(campaign)
    ]


def deepest_expected(campaign: Campaign) -> float:
    """Depth (m) that the fastest and heaviest projectile is expected to reach in dust of the nominal strength."""
    return max(setting.expected_depth for setting in _list_settings(campaign, read_value(campaign.material)))


def deepest_dust(campaign: Campaign) -> float:
    """Depth (m) of the dust that simulations of this campaign hold at most, which is where its strength is least; gradients
    must stay physical down to there."""
    if campaign.geometry == "planar":
        box = campaign.planar
        return max(box.box_depth * radius / box.box_radius for radius, _, _ in list_impacts(campaign))
    return max(setting.extent[1] for setting in _list_settings(campaign, campaign.p_m_range[0]))


__all__ = [
    "KINDS",
    "OBSERVABLES",
    "Cauchy",
    "Effect",
    "HalfNormal",
    "Instrument",
    "Kind",
    "LogNormal",
    "Normal",
    "Parameter",
    "Place",
    "Prior",
    "Uniform",
    "Values",
    "all_pushed",
    "deepest_dust",
    "deepest_expected",
    "find_middle",
    "list_impacts",
    "list_places",
]
