"""A force on the rod that grows with its immersed length, against the motion.

Stated for a rod of 1 mm diameter. It acts on the circumference, so it is scaled with the radius; beads have no side.
"""

from labsim.effects import HalfNormal, Parameter, all_pushed
from labsim.sph.profile import has_shaft
from labsim.sph.tips import make_profile

REFERENCE_RADIUS = 0.5e-3  # m

title = "A side force on the rod"
kind = "contact"
parameters = (
    Parameter(
        "force_per_length",
        "N/m",
        null=0.0,
        limits=(0.0, 3.0),
        prior=HalfNormal(0.4),
        step=0.15,
        symbol="f",
        text="Per immersed length of a rod of 1 mm diameter. Dust sheared along the whole circumference at its shear "
        "strength (about 450 Pa at φ = 0.2) gives 1.4 N/m; friction on less pressure a fraction of it.",
    ),
)
leaves = (
    "Long thin rods stop early in deep drops, and the deceleration rises towards the end; light projectiles most, beads not "
    "at all, so that rods and the bead in the CT disagree on p_m."
)
references = ("Bound: shear strength of the dust times the rod's circumference",)
expect = {"penetration_depth": -1, "stopping_time": -1}


def applies(campaign):
    if all_pushed(campaign):
        return "every projectile is pushed"
    if campaign.geometry == "planar":
        return "the nominal model is planar, and a lying cylinder has no side"
    if not any(has_shaft(make_profile(drop.projectile)) for drop in campaign.drops):
        return "no drop was made with a rod"
    return ""


def change_setting(setting, values, place):
    if not has_shaft(make_profile(setting.projectile)):
        return setting
    radius = setting.projectile.tip_radius
    return setting.replace(side_friction=values["force_per_length"] * (radius / REFERENCE_RADIUS))
