"""A planar run in place of a drop of a round projectile, and the readings of the factor between them.

The seed simulates an infinite cylinder. At equal density its mass per area is larger than a sphere's by 3π/8, and
the seed multiplies by 8/(3π) "for the penetration depth". Its target of 0.82 mm is 8/(3π) times what its own law
gives for the sphere, so the factor has been put on the measured depth; the argument itself puts it on the simulated
one. Both readings, and none at all, are offered, recorded, and stand beside each other (Güttler et al. 2009).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from ..records import Campaign, Projectile
from ..sph import DropSetting, Numerics

PLANAR_FACTOR = 8.0 / (3.0 * math.pi)
DURATION_PER_RADIUS = (
    40.0  # s/m: 22 ms for that cylinder, several stopping times of the softest dust in the prior
)
ALPHA = 0.1  # artificial viscosity; more of it would stop the projectile in place of the dust

READINGS = {
    "multiply_exp": "raw planar depth = 8/(3π) x measured (as the seed reads it)",
    "none": "raw planar depth = measured",
    "multiply_sim": "8/(3π) x raw planar depth = measured (as the argument has it)",
}


def expected_raw_depth(measured: float, reading: str) -> float:
    """The raw depth (m) a planar run must reach where a round projectile went ``measured`` deep."""
    return (
        measured * {"multiply_exp": PLANAR_FACTOR, "none": 1.0, "multiply_sim": 1.0 / PLANAR_FACTOR}[reading]
    )


def round_depth(raw: float, reading: str) -> float:
    """The depth (m) of a round projectile that a raw planar depth stands for."""
    return raw / expected_raw_depth(1.0, reading)


def planar_setting(
    campaign: Campaign,
    projectile: Projectile,
    speed: float,
    p_m: float,
    *,
    bulk_modulus: float | None = None,
    spacing: float = 1.0e-4,
) -> DropSetting:
    """The cylinder that stands for a round projectile.

    Same radius, and the density of a sphere of that radius and mass. ``spacing`` (m) is meant for the radius that
    the box belongs to; box and spacing scale with the radius, so every size has the same number of particles.
    """
    radius = projectile.tip_radius
    scale = radius / campaign.planar.box_radius
    density = projectile.mass / (4.0 / 3.0 * math.pi * radius**3)
    material = campaign.material.replace(p_m=float(p_m))
    if bulk_modulus is not None:
        material = material.replace(bulk_modulus=float(bulk_modulus))
    return DropSetting(
        projectile=replace(
            projectile, tip="cylinder", mass=density * math.pi * radius**2, mass_sigma=0.0, length=0.0
        ),
        impact_speed=speed,
        material=material,
        filling_factor=campaign.sample.filling_factor,
        monomer_density=campaign.sample.monomer_density,
        gravity=campaign.gravity,
        geometry="planar",
        spacing=spacing * scale,
        duration=DURATION_PER_RADIUS * radius,
        after_stop=0.0,
        numerics=Numerics(alpha=ALPHA),
        width=campaign.planar.box_width * scale,
        depth=campaign.planar.box_depth * scale,
    )


def settings_over(
    campaign: Campaign,
    projectile: Projectile,
    speeds: Sequence[float],
    p_m: Sequence[float],
    **options: float | None,
) -> list[DropSetting]:
    """One setting per p_m and speed, p_m slowest."""
    return [planar_setting(campaign, projectile, v, p, **options) for p in p_m for v in speeds]  # type: ignore[arg-type]
