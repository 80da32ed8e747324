"""The nouns of labsim: frozen records, everything in SI.

Input: nothing but numbers. Output: nothing but numbers. Files are read in ``campaign``, ``video`` and ``ct``;
physics is done in ``sph``. A record only holds what was stated or measured.
"""

from __future__ import annotations

import collections
import html
import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt
from jaxtyping import Bool, Float, Int, Real

FloatArray = npt.NDArray[np.floating[Any]]

STANDARD_GRAVITY = (
    9.81  # m/s^2, of every free fall, and of the nominal model where a campaign says nothing else
)
ALWAYS = (-math.inf, math.inf)  # s: the window of a record without one


class Summarised:
    """What a record is in a few lines: so it shows itself in a shell and in a notebook, however many numbers it holds."""

    def say(self) -> str:
        """What the record is, in one line."""
        raise NotImplementedError

    def summary(self) -> str:
        """The record in a few lines: what it is, and its warnings."""
        warnings = getattr(self, "warnings", ())
        return "\n".join([self.say(), *(f"warning: {text}" for text in warnings)])

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.say()}>"

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(self.summary())}</pre>"


@dataclass(frozen=True)
class Measured:
    """A value with its standard uncertainty.

    Parameters
    ----------
    value, sigma : float
        In the same SI unit; sigma is one standard deviation.
    """

    value: float
    sigma: float


@dataclass(frozen=True)
class Sample:
    """The dust as prepared."""

    filling_factor: float
    filling_factor_sigma: float
    monomer_density: float  # kg/m^3, of the solid grains
    diameter: float  # m
    depth: float  # m
    gas_pressure: float  # Pa
    scatter: float | None = None  # relative, of the strength from sample to sample, where it is known


@dataclass(frozen=True)
class Material:
    """Strengths and elasticity of the dust (campaign.toml ``[material]``), p_m included.

    Σ(φ) = p_m ((φ - φ1)/(φ2 - φ))^(Δ ln 10); T(φ) = -10^(a + b φ) Pa; Y = shear_factor √(Σ|T|);
    K(φ) = bulk_modulus (φ/0.15)^bulk_exponent; μ = shear_to_bulk K.

    Parameters
    ----------
    p_m : float
        Pa, the pressure scale of the compressive strength Σ.
    phi_1, phi_2, delta : float
        Filling factors between which Σ rises, and how steeply.
    tensile_log10_a, tensile_log10_b : float
        a and b of the tensile strength T.
    shear_factor : float
        Of the shear strength Y.
    bulk_modulus, bulk_exponent, shear_to_bulk : float
        Pa at a filling factor of 0.15; its exponent; shear over bulk modulus.
    contact_friction : float
        Coefficient of friction between dust and projectile.
    law : str
        A file of ``labsim/sph/materials``, or the path of one.
    constants : tuple of (str, float)
        Of another law: those of its parameters that are not at their defaults.

    References
    ----------
    Güttler et al. (2009), ApJ 701, 130, eqs. 4-6.
    """

    p_m: float = 1300.0  # Pa
    phi_1: float = 0.12
    phi_2: float = 0.58
    delta: float = 0.58
    tensile_log10_a: float = 2.8
    tensile_log10_b: float = 1.48
    shear_factor: float = 1.0
    bulk_modulus: float = 45.0e3  # Pa, at filling factor 0.15
    bulk_exponent: float = 4.0
    shear_to_bulk: float = 0.5
    contact_friction: float = 0.0
    law: str = "porous_dust"  # a file of labsim/sph/materials, or the path of one
    constants: tuple[
        tuple[str, float], ...
    ] = ()  # of another law: its parameters that are not at their defaults

    def replace(self, **changes: object) -> Material:
        return replace(self, **changes)  # type: ignore[arg-type]


@dataclass(frozen=True)
class Projectile:
    """A rigid projectile. A hemisphere is the end of a rod of the same radius; a cylinder is planar only.

    Parameters
    ----------
    tip : str
        A file of ``labsim/sph/tips``, or the path of one.
    tip_radius, radius_sigma, length : float
        m; the standard deviation of the radius; the length of the whole rod, 0 where it does not matter.
    mass, mass_sigma : float
        kg (planar: kg per metre of cylinder), with its standard deviation.
    shape : tuple of (str, float)
        The tip's own numbers that are not at their defaults, SI.
    """

    tip: str  # a file of labsim/sph/tips, or the path of one
    tip_radius: float  # m
    mass: float  # kg (planar: kg per metre of cylinder)
    mass_sigma: float = 0.0
    length: float = 0.0  # m, of the whole rod; 0 where it does not matter
    radius_sigma: float = 0.0
    shape: tuple[tuple[str, float], ...] = ()  # SI, the tip's own numbers that are not at their defaults

    @property
    def simulated(self) -> Projectile:
        """The same without what no simulation depends on: drops of equal ones share their runs."""
        return replace(self, mass_sigma=0.0, radius_sigma=0.0, length=0.0)


@dataclass(frozen=True)
class Motion:
    """What moves the projectile (drop.toml ``[motion]``)."""

    kind: str = "free"  # a file of labsim/sph/motions, or the path of one
    start_depth: float = 0.0  # m, of the tip in the dust when it starts
    values: tuple[tuple[str, float], ...] = ()  # SI, its own numbers that are not at their defaults
    table: tuple[tuple[float, float], ...] = ()  # (time s, depth m), where the kind wants one
    speed_sigma: float = 0.0  # m/s, of a push as it was measured


@dataclass(frozen=True)
class Camera:
    """A camera as it is stated.

    Parameters
    ----------
    frame_rate : float
        Hz.
    pixel_size, pixel_size_sigma : float
        m in the plane of the fall; its standard deviation where the scale was measured.
    surface_row, surface_row_sigma : float
        px, row of the dust's surface, with its standard deviation. Rows grow downwards.
    """

    frame_rate: float  # Hz
    pixel_size: float  # m
    surface_row: float  # px, rows grow downwards
    surface_row_sigma: float  # px
    pixel_size_sigma: float = 0.0  # m, where the scale was measured


@dataclass(frozen=True)
class Sensor:
    """One sensor of an accelerometer. sigma (of a sample), offset_sigma, range, zero : m/s²; scale_sigma : relative."""

    column: str
    sigma: float
    offset_sigma: float
    scale_sigma: float
    range: float  # readings beyond it mean nothing; inf where none is stated
    zero: float = 0.0  # what it reads too much, where its own record shows it


@dataclass(frozen=True)
class Accelerometer:
    """What stands on the projectile. time_column : of a table, "" where the format has a clock; sensors : of one record, finest
    range first; unit : m/s² of one of its numbers; reads_at_rest : m/s² upwards, gravity or nothing; window : s on the
    record's clock, of the drop."""

    time_column: str
    sensors: tuple[Sensor, ...]
    unit: float
    reads_at_rest: float
    window: tuple[float, float] = ALWAYS


@dataclass(frozen=True)
class Sleeve:
    """The friction sleeve behind a pushed tip. column : of a table, "" where the format has its own; unit : Pa of one of its
    numbers; sigma (of a row), offset_sigma : Pa; scale_sigma : relative; compared : whether it counts, or is shown alone."""

    column: str = ""
    unit: float = 1e3
    sigma: float = 0.0
    offset_sigma: float = 0.0
    scale_sigma: float = 0.0
    compared: bool = False


@dataclass(frozen=True)
class Gauge:
    """What logs a push. depth_column, column : of a table, "" where the format has its own; unit, depth_unit : SI of one of their
    numbers; sigma (of a row), offset_sigma : SI, N of a force, else Pa; scale_sigma : relative; window : m, what is compared;
    surface : m, where the record's depth has the surface."""

    depth_column: str
    column: str
    is_force: bool
    depth_unit: float
    unit: float
    sigma: float
    offset_sigma: float
    scale_sigma: float
    window: tuple[float, float]
    surface: float = 0.0
    sleeve: Sleeve = Sleeve()

    def per_pressure(self, section: float) -> float:
        """What a number of the gauge is divided by to become Pa on a tip's section (m²)."""
        return section if self.is_force else 1.0

    @property
    def feels_shaft(self) -> bool:
        """A column of forces is what holds the whole projectile; pressures, and what penetrometers log, are the tip's own."""
        return self.is_force and bool(self.column)


@dataclass(frozen=True)
class Record:
    """Where the record of a drop is: ``kind`` is "track", "video", "acceleration", "force" or "summary".

    region : left, top, right, bottom (px, the last column and row included) of the part of the picture that is searched, None for
    all of it. left_out : frame numbers whose rows are not used.
    """

    kind: Literal["track", "video", "acceleration", "force", "summary"]
    path: Path | None = None
    row_sigma: float | None = None  # px
    region: tuple[int, int, int, int] | None = None
    left_out: tuple[int, ...] = ()


@dataclass(frozen=True)
class Published:
    """Published figures of one drop (record.kind = "summary"); None where the source gives none."""

    penetration_depth: Measured | None = None  # m
    stopping_time: Measured | None = None  # s
    impact_speed: Measured | None = None  # m/s


@dataclass(frozen=True)
class Drop:
    name: str
    projectile: Projectile
    sequence: int
    height: Measured | None  # m, free fall of the tip above the surface
    camera: Camera | None
    record: Record
    published: Published | None = None
    source: dict = field(
        default_factory=dict
    )  # [source] as written: where each figure comes from, what is assumed
    motion: Motion = Motion()
    accelerometer: Accelerometer | None = None
    impact_speed: Measured | None = None  # m/s, where it was measured beside the record
    gauge: Gauge | None = None
    position: tuple[float, float] | None = None  # m, east and north, where the place of a push matters
    same_as: str = ""  # the drop of which this is another record, by another instrument

    @property
    def sample(self) -> str:
        """Name of the dust that was hit: two records of one drop have it in common."""
        return self.same_as or self.name


@dataclass(frozen=True)
class GreyCalibration:
    """grey = grey_air + grey_per_density · ρ, levels past the top of the range saturate."""

    grey_air: float
    grey_per_density: float  # per kg/m^3
    density_solid: float  # kg/m^3


@dataclass(frozen=True)
class Scan:
    """One CT scan of an embedded bead."""

    name: str
    projectile: Projectile
    speed: Measured  # m/s at contact
    slices: Path
    voxel: float  # m
    first_slice: Literal["top", "bottom"]
    bits: int
    calibration: GreyCalibration
    axis: tuple[float, float] | None = (
        None  # px, column and row of the axis where it is stated; else the bead tells
    )


@dataclass(frozen=True)
class PublishedScan:
    """A published compaction figure instead of slices: volume of dust between two filling factors."""

    name: str
    projectile: Projectile
    speed: Measured  # m/s at contact
    filling_factor_low: float
    filling_factor_high: float
    sphere_volumes: Measured  # compacted volume in volumes of the projectile's sphere
    source: dict = field(default_factory=dict)


@dataclass(frozen=True)
class Planar:
    """How a planar run of a cylinder stands for a drop of a round projectile (campaign.toml ``[planar]``).

    ``depth_reading``: "multiply_exp" compares the raw planar depth with 8/(3π) times the measured one (as the seed
    does), "multiply_sim" compares 8/(3π) times the raw depth with the measured one, "none" compares them as they are.
    """

    depth_reading: Literal["multiply_exp", "multiply_sim", "none"] = "multiply_exp"
    calibration_drops: tuple[str, ...] = ()  # names of the drops that are calibrated on; empty = all
    box_width: float = 8.0e-3  # m, of the planar box for the reference radius; scales with the radius
    box_depth: float = 5.0e-3
    box_radius: float = 0.55e-3  # m, the radius that the box belongs to


StrengthKind = Literal["compression_omnidirectional", "compression_unidirectional", "tension", "shear"]
STRENGTH_KINDS: tuple[StrengthKind, ...] = get_args(StrengthKind)


@dataclass(frozen=True)
class StrengthTest:
    """One static test of the dust. points : (filling factor, stress in Pa) of each row; relative_sigma : of the stress."""

    name: str
    kind: StrengthKind
    points: tuple[tuple[float, float], ...]
    relative_sigma: float
    source: dict = field(default_factory=dict)  # strength.toml [source] as written


@dataclass(frozen=True, repr=False)
class Campaign(Summarised):
    """One series of drops into one kind of sample, as read from its folder (campaign.read_campaign)."""

    folder: Path
    name: str
    description: str
    sample: Sample
    material: Material  # nominal; its p_m (or what else is calibrated) is the geometric middle of p_m_range
    p_m_range: tuple[float, float]  # Pa, the prior's limits
    gravity: float  # m/s^2 in the nominal model
    geometry: Literal["axisymmetric", "planar"]
    drops: tuple[Drop, ...]
    scans: tuple[Scan, ...]
    published_scans: tuple[PublishedScan, ...] = ()
    planar: Planar = Planar()
    source: dict = field(default_factory=dict)  # campaign.toml [source] as written
    calibrated: str = "p_m"  # the parameter of the law that p_m_range is the range of
    strength_tests: tuple[StrengthTest, ...] = ()

    @property
    def has_records(self) -> bool:
        """Whether a drop was recorded; of the others only published figures are known."""
        return any(drop.record.kind != "summary" for drop in self.drops)

    def say(self) -> str:
        """Its name, and how much of what is in it."""
        kinds = collections.Counter(drop.record.kind for drop in self.drops)
        held = [f"{count} drops ({kind})" for kind, count in kinds.items()]
        held += [f"{len(self.scans)} CT scans"] * bool(self.scans)
        held += [f"{len(self.strength_tests)} static tests"] * bool(self.strength_tests)
        return f"{self.name}, {', '.join(held)}"

    def summary(self) -> str:
        """What is in it, and what it says of itself."""
        return f"{self.say()}\n{self.description}".rstrip()


@dataclass(frozen=True, repr=False)
class Track(Summarised):
    """Rows of the projectile's tip, one entry per trusted or rejected frame.

    frame : (n,) int; time : (n,) s; tip_row, sigma : (n,) px; valid : (n,) bool; reason : (n,) str, "" where valid.
    """

    frame: Int[np.ndarray, " n"]
    time: Float[np.ndarray, " n"]
    tip_row: Float[np.ndarray, " n"]
    sigma: Float[np.ndarray, " n"]
    valid: Bool[np.ndarray, " n"]
    reason: tuple[str, ...]
    warnings: tuple[str, ...] = ()

    def say(self) -> str:
        """How many frames, and how good."""
        rejected = int(np.sum(~self.valid))
        sigma = float(np.median(self.sigma[self.valid])) if self.valid.any() else math.nan
        return f"{self.frame.size} frames, {rejected} rejected, rows to {sigma:.3f} px"


@dataclass(frozen=True, repr=False)
class DecelerationCurve(Summarised):
    """Motion of the tip below the undisturbed surface; arrays of shape (n,), time zero at contact.

    depth, depth_sigma : m; velocity, velocity_sigma : m/s (downwards positive);
    acceleration, acceleration_sigma : m/s^2.
    """

    time: Float[np.ndarray, " n"]
    depth: Float[np.ndarray, " n"]
    depth_sigma: Float[np.ndarray, " n"]
    velocity: Float[np.ndarray, " n"]
    velocity_sigma: Float[np.ndarray, " n"]
    acceleration: Float[np.ndarray, " n"]
    acceleration_sigma: Float[np.ndarray, " n"]
    contact_time: Measured  # s, on the track's clock
    impact_speed: Measured  # m/s
    penetration_depth: Measured  # m
    stopping_time: Measured  # s, contact to the first v = 0
    warnings: tuple[str, ...] = ()
    stopping_time_2_percent: Measured | None = None  # s, contact to v = 2 % of the impact speed
    # m/s^2 of the free flight; off where pixel scale or frame rate is
    apparent_gravity: Measured | None = None
    rebound_speed: Measured | None = None  # m/s upwards, None where the projectile comes to rest
    # px, (m,) every frame of the track minus the fit, NaN where not fitted
    residual: Float[np.ndarray, " m"] | None = None
    used: Bool[np.ndarray, " m"] | None = None  # (m,) frames of the track that the fit stands on
    degree: int | None = None  # of the polynomial of the deceleration
    # s, (m,) times of the track's frames as the fit took them: not the track's where frames were lost silently
    clock: Float[np.ndarray, " m"] | None = None

    def say(self) -> str:
        """Depth, speed and stopping time."""
        depth, speed, stop = self.penetration_depth, self.impact_speed, self.stopping_time
        return (
            f"{depth.value * 1e3:.4g} ± {depth.sigma * 1e3:.2g} mm deep from {speed.value:.4g} ± {speed.sigma:.2g} m/s in "
            f"{stop.value * 1e3:.4g} ± {stop.sigma * 1e3:.2g} ms"
        )


@dataclass(frozen=True, repr=False)
class FillingMap(Summarised):
    """Azimuthal mean of the filling factor about the axis of penetration.

    r : (nr,) m, cell centres; z : (nz,) m, cell centres, 0 at the undisturbed surface, negative below;
    filling_factor, sigma : (nz, nr), NaN where nothing was averaged; count : (nz, nr) voxels in the mean.
    """

    r: Float[np.ndarray, " nr"]
    z: Float[np.ndarray, " nz"]
    filling_factor: Float[np.ndarray, "nz nr"]
    sigma: Float[np.ndarray, "nz nr"]
    count: Real[np.ndarray, "nz nr"]
    tip_depth: float  # m, lowest point of the bead below the undisturbed surface, positive
    bead_radius: float  # m
    axis_px: tuple[float, float]
    warnings: tuple[str, ...] = ()

    def say(self) -> str:
        """Size, the tip's depth, and the filling factors that occur."""
        low, high = np.nanquantile(self.filling_factor, [0.01, 0.99])
        return (
            f"{self.z.size} x {self.r.size} cells to {self.r[-1] * 1e3:.3g} mm from the axis, tip {self.tip_depth * 1e3:.3g} mm "
            f"deep, filling factor {low:.2g} to {high:.2g}"
        )


@dataclass(frozen=True, repr=False)
class CompressedVolume(Summarised):
    """Volume compacted beyond a filling factor; arrays of shape (n,).

    filling_factor : thresholds; volume, sigma : m^3 of dust with a larger filling factor.
    """

    filling_factor: FloatArray
    volume: FloatArray
    sigma: FloatArray
    sphere_volume: float  # m^3, of the projectile's tip sphere

    def say(self) -> str:
        """The volume that is denser than the threshold in the middle of those it has."""
        k = self.filling_factor.size // 2
        volume, sigma = self.volume[k], self.sigma[k]
        return (
            f"denser than {self.filling_factor[k]:.3g}: {volume * 1e9:.3g} ± {sigma * 1e9:.2g} mm³, "
            f"{volume / self.sphere_volume:.2g} sphere volumes"
        )


__all__ = [
    name
    for name, thing in list(globals().items())
    if isinstance(thing, type) and thing.__module__ == __name__
]
