"""The tensile strength differs by a factor: T(φ) = -factor 10^(a + bφ) Pa. Y = √(Σ|T|) changes with its root."""

import math

from labsim.effects import LogNormal, Parameter

title = "The tensile strength differs by a factor"
says = ("The tensile strength is less than stated", "The tensile strength is more than stated")
kind = "material"
needs = ("tensile_log10_a",)
parameters = (
    Parameter(
        "factor",
        "1",
        null=1.0,
        limits=(0.05, 20.0),
        prior=LogNormal(1.0, 0.6),
        step=0.5,
        symbol="T/T0",
        text="Tensile tests of such dusts scatter between 0.3 and 3 times the fitted line with grain shape and preparation.",
    ),
)
leaves = (
    "Half of what the logarithm of a shear factor does, since Y = √(Σ|T|), and more adhesion on rebound; alone in the "
    "tracks it looks like another p_m."
)
references = (
    "Güttler et al. (2009), eq. 5",
    "Blum & Schräpler (2004)",
    "Meisner et al. (2012): Brazilian tests of irregular quartz",
)
expect = {"penetration_depth": -1, "stopping_time": -1}


def change_setting(setting, values, place):
    material = setting.material
    return setting.replace(
        material=material.replace(tensile_log10_a=material.tensile_log10_a + math.log10(values["factor"]))
    )
