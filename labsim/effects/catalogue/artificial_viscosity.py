"""The artificial viscosity, not the material, stops the projectile: another α, β in proportion."""

from dataclasses import replace

from labsim.effects import LogNormal, Parameter
from labsim.sph import Numerics

title = "The artificial viscosity stops the projectile"
says = ("The artificial viscosity is smaller than stated", "The artificial viscosity stops the projectile")
kind = "numerics"
IN_USE = Numerics().alpha  # settings with another α are scaled alike

parameters = (
    Parameter(
        "alpha",
        "1",
        null=IN_USE,
        limits=(0.05, 2.0),
        prior=LogNormal(IN_USE, 0.7),
        step=0.5 * IN_USE,
        symbol="α",
        text="Values in use for such impacts lie between 0.1 and 2; dust itself has none.",
    ),
)
leaves = (
    "What a rate term leaves, proportional to the spacing: fast drops stop early. It goes away at a finer spacing, a rate "
    "term does not; run.json says which share of the energy it took."
)
references = (
    "Monaghan (1992)",
    "Geretshauser, Speith, Güttler, Krause & Blum (2010): choice of α",
)
expect = {"penetration_depth": -1}


def change_setting(setting, values, place):
    factor = values["alpha"] / IN_USE
    numerics = setting.numerics
    return setting.replace(
        numerics=replace(numerics, alpha=numerics.alpha * factor, beta=numerics.beta * factor)
    )
