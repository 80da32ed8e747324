"""What is simulated: one drop, as plain data. A run is a pure function of this record and of the solver's sources."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from ..errors import SimulationError
from ..records import STANDARD_GRAVITY, FloatArray, Material, Motion, Projectile
from .materials import find_law
from .motions import make_path
from .plugins import Parameter, key_of
from .tips import find_tip, make_profile

LOOSEST = 0.005  # of φ over φ1, that a gradient leaves
LEAST_GRADED = 3.0  # tip radii that a falling φ0 must fall through before it stays as it is


@dataclass(frozen=True)
class Numerics:
    """Choices of the discretisation; docs/numerics.md gives the measured effect of each on the depth."""

    smoothing: float = 1.2  # smoothing length in spacings; the kernel ends at twice that
    alpha: float = 0.3  # artificial viscosity, on what two particles' own velocity gradients leave of a jump
    beta: float = 0.0  # its quadratic part
    affine: float = 1.0  # share of the linear velocity field taken out of the jump; 0 is Monaghan's viscosity
    front: float = (
        0.0  # compression h |div v| / c along one line from which on the jump stays whole; 0: nowhere
    )
    artificial_stress: float = (
        0.0  # of the tension of a pair, holds it apart; for bodies without a tensile limit, dust has one
    )
    courant: float = 0.9  # time step in smoothing lengths over the largest sound speed
    exchange: float = (
        2.0  # diffusivity of the compaction where dust is being compacted, in h² times that rate
    )
    skin: float = 0.3  # of the neighbour list, in smoothing lengths


@dataclass(frozen=True)
class DropSetting:
    """One drop. SI throughout; in the plane the projectile's mass is per metre of cylinder.

    Parameters
    ----------
    projectile, material : Projectile, Material
        What falls, and into what.
    impact_speed : float
        m/s at the start, of a free projectile; of no meaning to one that is led.
    filling_factor, monomer_density : float
        Of the dust at the start; kg/m³ of its grains' own material.
    gravity : float
        m/s².
    geometry : str
        "axisymmetric" or "planar".
    spacing : float
        m, between particles. A sixth to an eighth of the tip's radius is usual.
    duration, after_stop : float
        s, when the run ends at the latest; how long it goes on after the stop, in stopping times.
    width, depth : float, optional
        m of the dust: half width (planar: full width) and depth. Default: enough for this drop.
    numerics : Numerics
        Choices of the discretisation.
    motion : Motion
        What moves the projectile: by default it falls freely.
    strength_rate, strength_rate_exponent : float
        Σ (1 + strength_rate ε̇ⁿ). Like all that follow, a term of an effect that does nothing at its default.
    pore_gas : float
        Pa of gas in the pores.
    crust_excess, crust_length, filling_gradient : float
        The dust begins at φ0 + crust_excess exp(-depth / crust_length) + filling_gradient depth; 1, m, 1/m.
    side_friction : float
        N/m, times the immersed length.
    strength_shape : tuple of (float, float)
        Filling factor and factor on Σ; tables are linear between their rows.
    strength_of_strain, shear_of_strain : tuple of (float, float)
        Plastic shear strain and factor on Σ, or on Y.
    strength_of_depth : tuple of (float, float)
        m below the surface, of undisturbed dust, and factor on the Σ that this dust keeps.
    strength_of_time : tuple of (float, float)
        s since the start, and factor on the Σ of all dust then.
    force_of_depth, force_of_speed, force_of_time : tuple of (float, float)
        m and N upwards; m/s, or s since the start, and N against the motion.
    viscosity_of_depth, drag_of_depth : tuple of (float, float)
        m and what times the speed, N s/m, or times its square, N s²/m², is a force against the motion.
    mass_of_depth, gathered_of_depth : tuple of (float, float)
        m and kg of dust that move with the tip: it has the tip's speed when it sticks, or lies still, so that the tip gives it
        its momentum.
    """

    projectile: Projectile
    impact_speed: float  # m/s, at the start, of a free projectile; of no meaning to one that is led
    material: Material
    filling_factor: float = 0.15
    monomer_density: float = 2000.0  # kg/m^3
    gravity: float = STANDARD_GRAVITY  # m/s^2
    geometry: Literal["planar", "axisymmetric"] = "axisymmetric"
    spacing: float = 6.25e-5  # m
    duration: float = 0.05  # s, the run ends here at the latest
    after_stop: float = 0.2  # how long it goes on after the stop, in stopping times
    width: float | None = None  # m, half width in r-z, full width in the plane; None: enough for this drop
    depth: float | None = None  # m, of the dust; None: enough for this drop
    numerics: Numerics = field(default_factory=Numerics)
    motion: Motion = field(default_factory=Motion)

    strength_rate: float = 0.0  # s^n, Σ (1 + strength_rate ε̇^n)
    strength_rate_exponent: float = 0.5
    pore_gas: float = 0.0  # Pa
    crust_excess: float = 0.0  # φ0 + crust_excess exp(-depth / crust_length)
    crust_length: float = 3.0e-4  # m
    filling_gradient: float = 0.0  # 1/m, growth of φ0 with depth, down to graded_depth
    side_friction: float = 0.0  # N/m (planar: N/m per metre), times the immersed length
    strength_shape: tuple[tuple[float, float], ...] = ()  # (φ, factor on Σ), linear between, constant beyond
    strength_of_strain: tuple[tuple[float, float], ...] = ()  # (plastic shear strain, factor on Σ)
    shear_of_strain: tuple[tuple[float, float], ...] = ()  # (plastic shear strain, factor on Y)
    strength_of_depth: tuple[tuple[float, float], ...] = ()  # (depth m of undisturbed dust, factor on its Σ)
    strength_of_time: tuple[tuple[float, float], ...] = ()  # (time s, factor on Σ)
    force_of_depth: tuple[tuple[float, float], ...] = ()  # (depth m, upward force N), linear between
    force_of_speed: tuple[
        tuple[float, float], ...
    ] = ()  # (speed m/s, force N against the motion), linear between
    force_of_time: tuple[
        tuple[float, float], ...
    ] = ()  # (time s, force N against the motion), linear between
    viscosity_of_depth: tuple[
        tuple[float, float], ...
    ] = ()  # (depth m, N s/m against the motion), linear between
    drag_of_depth: tuple[
        tuple[float, float], ...
    ] = ()  # (depth m, N s²/m² against the motion), linear between
    mass_of_depth: tuple[
        tuple[float, float], ...
    ] = ()  # (depth m, kg of dust that move with the tip), linear between
    gathered_of_depth: tuple[
        tuple[float, float], ...
    ] = ()  # the same, of dust that lies still until the tip takes it along

    def replace(self, **changes: object) -> DropSetting:
        return replace(self, **changes)  # type: ignore[arg-type]

    @property
    def path(self) -> tuple[FloatArray, FloatArray]:
        """Times (s) and depths (m) that a driver leads the tip through; empty for a free one."""
        return make_path(self.motion)

    @property
    def expected_depth(self) -> float:
        """Depth (m) that the tip may reach. A driver's path says it; for a drop a little less than D = 8e-4 m v / A, in m, kg
        and s (Güttler et al. 2009), for dust of 1300 Pa or more, deeper in softer dust with the third root of its strength. It
        only sizes boxes."""
        _, led = self.path
        if led.size:
            return float(led.max())
        area = base_area(self)
        strength = max(find_law(self.material.law).resistance(self), 1.0)
        # softer dust lets it through to where the bottom would be felt
        return self.motion.start_depth + float(
            7e-4 * self.projectile.mass * self.impact_speed / area * max(1.0, 1300.0 / strength) ** (1 / 3)
        )

    @property
    def extent(self) -> tuple[float, float]:
        """Width (half width in r-z) and depth of the dust that is simulated, m, whole numbers of spacings."""
        radius = self.projectile.tip_radius
        planar = self.geometry == "planar"
        width = self.width if self.width is not None else (16 * radius if planar else 4 * radius)
        least = 6 * radius if planar else 5 * radius
        spare = least - 3 * radius  # below what is expected to be reached
        depth = self.depth if self.depth is not None else max(least, spare + 1.5 * self.expected_depth)
        cells = 2 * round(width / self.spacing / 2) if planar else round(width / self.spacing)
        return cells * self.spacing, round(depth / self.spacing) * self.spacing

    @property
    def graded_depth(self) -> float:
        """Depth (m) from which on φ0 stays as it is: where a falling one comes near φ1, where there is no strength."""
        if self.filling_gradient >= 0.0:
            return math.inf
        return max(self.filling_factor - self.material.phi_1 - LOOSEST, 0.0) / -self.filling_gradient


def check_setting(setting: DropSetting) -> None:
    """Raise SimulationError, naming the value and what would do, where the solver's limits of validity end."""

    def refuse(key: str, message: str) -> None:
        raise SimulationError("simulation", key, message)

    law, projectile = find_law(setting.material.law), setting.projectile
    time, led = setting.path
    speed = setting.impact_speed
    if time.size:
        speed = max(abs(led[1:] - led[:-1]) / (time[1:] - time[:-1]))
    for key in ("impact_speed", "filling_factor", "monomer_density", "spacing", "duration"):
        value = getattr(setting, key)
        if not (math.isfinite(value) and value > 0):
            refuse(key, f"is {value!r}; it must be a positive number")
    if not (projectile.tip_radius > 0 and projectile.mass > 0):
        refuse(
            "projectile",
            f"radius {projectile.tip_radius!r} m, mass {projectile.mass!r} kg; both must be positive",
        )
    make_profile(projectile)
    if setting.geometry not in getattr(find_tip(projectile.tip), "GEOMETRIES", (setting.geometry,)):
        refuse("projectile.tip", f"a {projectile.tip} is planar; choose another tip, or geometry planar")
    if setting.spacing > projectile.tip_radius / 4 * 1.0000001:
        refuse(
            "spacing",
            f"{setting.spacing:.3g} m does not resolve a tip of {projectile.tip_radius:.3g} m; "
            f"use {projectile.tip_radius / 4:.3g} m or less",
        )
    start = setting.motion.start_depth
    if start and not 0.0 < start < setting.extent[1] - 3 * projectile.tip_radius:
        refuse(
            "motion.start_depth",
            f"is {start:g} m; at least three tip radii of the {setting.extent[1]:g} m of dust must lie below the tip",
        )
    law.check(setting, refuse)
    if setting.graded_depth < LEAST_GRADED * projectile.tip_radius:
        refuse(
            "filling_gradient",
            f"{setting.filling_gradient:.4g} per m leaves no strength {setting.graded_depth * 1e3:.3g} mm down, where "
            f"the projectile acts; at least {LEAST_GRADED:g} tip radii must lie above that",
        )
    sound = law.sound_speed(setting)
    if speed >= sound:
        refuse(
            "motion" if time.size else "impact_speed",
            f"{speed:.3g} m/s is not below the sound speed {sound:.3g} m/s of this dust; "
            "lower the speed or raise bulk_modulus",
        )


def base_area(setting: DropSetting) -> float:
    """Section (m²; planar: width, m) of a circle of the tip radius."""
    radius = setting.projectile.tip_radius
    return 2 * radius if setting.geometry == "planar" else math.pi * radius**2


def say_projectile(setting: DropSetting) -> str:
    """Tip, radius, and the tip's own numbers that are not at their defaults."""
    own = {each.name: each for each in find_tip(setting.projectile.tip).PARAMETERS}
    return f"{Path(setting.projectile.tip).stem} R {setting.projectile.tip_radius * 1e3:g} mm" + "".join(
        f", {_say_value(own[name], value)}" for name, value in setting.projectile.shape
    )


def say_motion(setting: DropSetting) -> str:
    """What moves it, as ``0.65 m/s`` or ``pushed from 0 to 2 mm at 0.1 m/s``."""
    time, led = setting.path
    start = setting.motion.start_depth
    if time.size:
        speed = max(abs(led[1:] - led[:-1]) / (time[1:] - time[:-1]))
        kind = Path(setting.motion.kind).stem
        return f"{kind} from {led[0] * 1e3:.4g} to {led[-1] * 1e3:.4g} mm at {speed:.4g} m/s"
    return f"{setting.impact_speed:.4g} m/s" + (f" from {start * 1e3:.4g} mm" if start else "")


def say_material(material: Material) -> str:
    """The law's strength and stiffness, or its numbers that are not at their defaults."""
    if material.law == "porous_dust":
        return f"p_m {material.p_m:.5g} Pa, K0 {material.bulk_modulus / 1e3:g} kPa"
    own = {each.name: each for each in find_law(material.law).PARAMETERS}
    return ", ".join(
        [Path(material.law).stem, *(_say_value(own[name], value) for name, value in material.constants)]
    )


def _say_value(parameter: Parameter, value: float) -> str:
    key, unit = key_of(parameter)
    return f"{parameter.name.replace('_', ' ')} {value / unit:.4g} {key.removeprefix(parameter.name)[1:]}".rstrip()
