"""The compressive strength grows with the rate of compression: Σ(φ) (1 + η ε̇ⁿ), ε̇ = -div v where dust is compressed.

Y = √(Σ|T|) grows with it. n is not known for dust; drops at several speeds into the same dust fix it.
"""

from labsim.effects import HalfNormal, Normal, Parameter

title = "The strength grows with the rate of compression"
kind = "material"
needs = ("strength_rate",)
parameters = (
    Parameter(
        "eta",
        "s^n",
        null=0.0,
        limits=(0.0, 1.0),
        prior=HalfNormal(0.05),
        step=0.03,
        symbol="η",
        text="Strengthening at 1/s. Rates at the tip are about speed over radius, 1000/s: 0.05 makes Σ there 2.5 times "
        "as large with n = 1/2, more than static and dynamic tests of the same dust leave room for.",
    ),
    Parameter(
        "n",
        "1",
        null=0.5,
        limits=(0.1, 1.0),
        prior=Normal(0.5, 0.15),
        step=0.1,
        shape=True,
        symbol="n",
        text="Exponent of the rate: nearly logarithmic creep is 0, a viscous fluid 1; the middle, without more knowledge.",
    ),
)
leaves = (
    "Fast drops stop too early for the p_m that fits slow ones, small tips more than large ones (the rate is speed over "
    "radius); the deceleration is largest at contact."
)
references = (
    "Seizinger, Speith & Kley (2012), arXiv:1203.3630: the compressive strength of dust depends on the speed of compression",
    "Güttler et al. (2009), Powders and Grains: static 13 kPa against dynamic 1.3 kPa",
)
expect = {"penetration_depth": -1, "stopping_time": -1}


def change_setting(setting, values, place):
    if values["eta"] == 0.0:
        return setting
    return setting.replace(strength_rate=values["eta"], strength_rate_exponent=values["n"])
