"""Gas trapped in the pores pushes back: the pressure is p + P0 ((1 - φi)/(1 - φ) - 1), φi the filling factor before the drop.

Isothermal and undrained: gas that has no time to leave. Draining only lowers P0, which is an effective pressure.
"""

from labsim.effects import HalfNormal, Parameter

title = "Gas trapped in the pores pushes back"
kind = "material"
needs = ("pore_gas",)
parameters = (
    Parameter(
        "P0",
        "Pa",
        null=0.0,
        limits=(0.0, 1.0e5),
        prior=HalfNormal(5.0e3),
        step=2.0e3,
        symbol="P0",
        text="Pressure of the gas that stays. A gauge may be off or the pores may not have been pumped out; compaction "
        "from 0.15 to 0.25 raises 5 kPa by 700 Pa, twice what stops the projectile. Atmospheric pressure is the limit.",
    ),
)
leaves = (
    "Resistance that grows with compaction and springs back: rebound, less dust above φ = 0.2 for the same depth, and a "
    "different change of depth with speed. It goes away when the chamber is pumped longer."
)
without = "in a chamber that is pumped out for longer"
references = (
    "Royer et al. (2007): gas in granular impact",
    "Ideal gas at constant temperature in the pore volume 1 - φ",
)
expect = {"penetration_depth": -1}


def change_setting(setting, values, place):
    return setting.replace(pore_gas=values["P0"])
