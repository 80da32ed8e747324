"""A planar run of a lying cylinder is compared with a round projectile; here the projectile is round, in r and z.

Same radius, same density, box of the same size. No parameter: the effect is on or off, and off for what is round already.
"""

import math
from dataclasses import replace

from labsim.sph import Numerics

title = "A planar run is compared with a round projectile"
kind = "numerics"
parameters = ()
leaves = (
    "p_m several times too large or too small and a wrong factor between depth and stopping time: the dust can go round a "
    "sphere on all sides, and its area grows with the square of the depth, a cylinder's with the root."
)
references = ("Güttler et al. (2009): the factor 8/(3π) between cylinder and sphere",)
expect = {"penetration_depth": -1, "stopping_time": -1}


def applies(campaign):
    return "" if campaign.geometry == "planar" else "the nominal model is round already"


def change_setting(setting, values, place):
    if setting.geometry == "axisymmetric":
        return setting
    radius = setting.projectile.tip_radius
    density = setting.projectile.mass / (math.pi * radius**2)
    return setting.replace(
        geometry="axisymmetric",
        projectile=replace(
            setting.projectile,
            tip="sphere" if place.tip == "cylinder" else place.tip,
            mass=density * 4.0 / 3.0 * math.pi * radius**3,
        ),
        spacing=min(setting.spacing, radius / 8.0),
        width=None if setting.width is None else setting.width / 2.0,
        numerics=Numerics(),
    )
