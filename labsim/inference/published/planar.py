"""A planar run in place of a drop of a round projectile, and the readings of the factor between them.

The seed simulates an infinite cylinder. At equal density its mass per area is larger than a sphere's by 3π/8, and
the seed multiplies by 8/(3π) "for the penetration depth". Its target of 0.82 mm is 8/(3π) times what its own law
gives for the sphere, so the factor has been put on the measured depth; the argument itself puts it on the simulated
one. Both readings, and none at all, are offered, recorded, and stand beside each other (Güttler et al. 2009).
"""

from __future__ import annotations

import math

from ...records import Campaign, Material, Planar, Projectile
from ...sph import DropSetting, Numerics

PLANAR_FACTOR = 8.0 / (3.0 * math.pi)
DURATION_PER_RADIUS = (
    40.0  # s/m: 22 ms for that cylinder, several stopping times of the softest dust in the prior
)
SPACING = 1.0e-4  # m, for the radius that the box belongs to
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
    projectile: Projectile,
    speed: float,
    material: Material,
    *,
    filling_factor: float = 0.15,
    monomer_density: float = 2000.0,
    gravity: float = 0.0,
    box: Planar | None = None,
    spacing: float | None = None,
) -> DropSetting:
    """The cylinder that stands for a round projectile: same radius, density of a sphere of that radius and mass.

    The box scales with the radius; so does the spacing (m), where none is given.
    """
    box = box or Planar()
    radius = projectile.tip_radius
    scale = radius / box.box_radius
    density = projectile.mass / (4.0 / 3.0 * math.pi * radius**3)
    return DropSetting(
        projectile=Projectile(tip="cylinder", tip_radius=radius, mass=density * math.pi * radius**2),
        impact_speed=speed,
        material=material,
        filling_factor=filling_factor,
        monomer_density=monomer_density,
        gravity=gravity,
        geometry="planar",
        spacing=spacing if spacing is not None else SPACING * scale,
        duration=DURATION_PER_RADIUS * radius,
        after_stop=0.0,
        width=box.box_width * scale,
        depth=box.box_depth * scale,
        numerics=Numerics(alpha=ALPHA),
    )


def campaign_setting(
    campaign: Campaign,
    projectile: Projectile,
    speed: float,
    p_m: float,
    *,
    bulk_modulus: float | None = None,
    spacing: float = SPACING,
) -> DropSetting:
    """The planar run of one projectile of a campaign; ``spacing`` (m) is meant for the radius the box belongs to."""
    material = campaign.material.replace(p_m=float(p_m))
    if bulk_modulus is not None:
        material = material.replace(bulk_modulus=float(bulk_modulus))
    return planar_setting(
        projectile,
        speed,
        material,
        filling_factor=campaign.sample.filling_factor,
        monomer_density=campaign.sample.monomer_density,
        gravity=campaign.gravity,
        box=campaign.planar,
        spacing=spacing * projectile.tip_radius / campaign.planar.box_radius,
    )
