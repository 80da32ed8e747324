"""The strength that static tests measure is not the dynamic one: Σ of a test at rest is Σ of a drop times this factor."""

from labsim.effects import LogNormal, Parameter

title = "The static strength is not the dynamic one"
says = (
    "The static strength is less than the dynamic one",
    "The static strength is more than the dynamic one",
)
kind = "material"
needs = ("p_m",)
parameters = (
    Parameter(
        "factor",
        "1",
        null=1.0,
        limits=(0.02, 50.0),
        prior=LogNormal(1.0, 1.2),
        step=0.3,
        symbol="p_m static/p_m dynamic",
        text="The same dust took 13 kPa in static compression and 1.3 kPa in drops. Strength that grows with the rate would make "
        "it less than one; a factor of three to either side is usual.",
    ),
)
leaves = (
    "Compression and shear tests lie above or below the curve that the drops ask for, by one factor at all filling factors. "
    "Drops and scans do not change."
)
references = ("Güttler et al. (2009): p_m of static tests and of drops",)
expect = {"penetration_depth": 0, "stopping_time": 0, "compacted_volume": 0}


def applies(campaign):
    tested = {"compression_omnidirectional", "shear"} & {test.kind for test in campaign.strength_tests}
    return "" if tested else "there is no static test of compression or shear"


def change_instrument(instrument, values, place):
    return instrument.replace(static_factor=instrument.static_factor * values["factor"])
