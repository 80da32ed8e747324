"""The strength grows with the rate of strain: of dust Σ(φ) (1 + η ε̇ⁿ), ε̇ = -div v where it is compressed; of any other law with
a strength that strength times 1 + λ log10(ε̇/ε̇₁), or times 1 + λ ((ε̇/ε̇₁)ⁿ - 1)/(n ln 10), whose limit of small n the logarithm
is. ε̇ is the rate of shear and ε̇₁ a thousand times the law's ``rate_reference``, below which the logarithm falls no further: state
the reference so that the rates of the campaign lie about ε̇₁. Both forms gain λ a decade at ε̇₁.

Y = √(Σ|T|) of dust grows with Σ. n is not known for dust; drops at several speeds into the same dust fix it. Clays are measured
by λ, their gain a decade.
"""

import math
from dataclasses import replace

from labsim.calibrated import find_parameter, read_constant, say_law, scale_value
from labsim.effects import HalfNormal, Normal, Parameter
from labsim.own_keys import DUST
from labsim.sph.materials import list_numbers

title = "The strength grows with the rate of strain"
kind = "material"
RATE = 1000.0  # 1/s, of dust at a tip
ETA = Parameter(
    "eta",
    "s^n",
    null=0.0,
    limits=(0.0, 1.0),
    prior=HalfNormal(0.05),
    step=0.03,
    symbol="η",
    text="Strengthening at 1/s. Rates at the tip are about speed over radius, 1000/s: 0.05 makes Σ there 2.5 times "
    "as large with n = 1/2, more than static and dynamic tests of the same dust leave room for.",
    doubles=RATE**-0.5,
)
N = Parameter(
    "n",
    "1",
    null=0.5,
    limits=(0.1, 1.0),
    prior=Normal(0.5, 0.15),
    step=0.1,
    shape=True,
    symbol="n",
    text="Exponent of the rate: nearly logarithmic creep is 0, a viscous fluid 1; the middle, without more knowledge.",
)
GAIN = Parameter(
    "per_decade",
    "1",
    null=0.0,
    limits=(0.0, 0.25),
    prior=HalfNormal(0.1),
    step=0.1,
    symbol="λ",
    text="Gain a decade of rate, of the strength at a thousand times the law's rate_reference: 0.05 to 0.2 for clays.",
)
FORM = Parameter(
    "n",
    "1",
    null=0.0,
    limits=(0.0, 1.0),
    prior=Normal(0.25, 0.15),
    step=0.1,
    shape=True,
    symbol="n",
    text="0: a logarithm of the rate; above, an additive power of it, of clays 0.1 to 0.4.",
)
DECADES = 3.0  # from the law's reference rate to the one at which what is calibrated is the strength
leaves = (
    "Fast drops stop too early for the p_m that fits slow ones, small tips more than large ones (the rate is speed over "
    "radius); the deceleration is largest at contact. Fast pushes meet more resistance than slow ones, by the same share at "
    "every depth."
)
references = (
    "Seizinger, Speith & Kley (2012): the compressive strength of dust depends on the speed of compression",
    "Güttler et al. (2009): static 13 kPa against dynamic 1.3 kPa",
    "Einav & Randolph (2005): gain of clays a decade of rate",
    "Zhu & Randolph (2011): an additive power of the rate in soft clays",
)
expect = {"penetration_depth": -1, "stopping_time": -1}


def parameters(campaign):
    return (ETA, N) if campaign.material.law == DUST else (GAIN, FORM)


def applies(campaign):
    law = campaign.material.law
    needed = "strength_rate" if law == DUST else "rate_log"
    return (
        "" if needed in list_numbers(law) else f"the law {say_law(law)} has no strength that a rate changes"
    )


def reshape(parameter, n):
    """η of another exponent that makes Σ at RATE as large; per_decade means the same with any n."""
    if parameter.name != ETA.name:
        return parameter
    factor = RATE ** (N.null - n)
    return replace(
        parameter,
        step=parameter.step * factor,
        doubles=parameter.doubles * factor,
        prior=HalfNormal(parameter.prior.sd * factor),
    )


def change_setting(setting, values, place):
    if "per_decade" in values:
        return _strengthen(setting, values["per_decade"], values["n"])
    if values["eta"] == 0.0:
        return setting
    return setting.replace(strength_rate=values["eta"], strength_rate_exponent=values["n"])


def _strengthen(setting, gain, n):
    """A law whose strength gains ``gain`` of its value at ε̇₁ a decade there, and is what it was at ε̇₁."""
    if gain == 0.0:
        return setting
    at_one = 10.0**DECADES * read_constant(setting.material, "rate_reference")
    by_rate = gain * DECADES if n == 0.0 else gain / (n * math.log(10.0))  # share of the strength at ε̇₁
    # an angle is no strength that could be restated
    at_rest = 1.0 - by_rate if find_parameter(setting.material.law)[1] == "Pa" else 1.0
    material = scale_value(setting.material, at_rest)
    if n == 0.0:
        rate = {"rate_log": gain / at_rest}
    else:
        rate = {
            "rate_eta": by_rate / at_rest * at_one**-n,
            "rate_exponent": n,
        }
    constants = dict(material.constants) | rate
    return setting.replace(material=material.replace(constants=tuple(constants.items())))
