"""The strength drifts from drop to drop in the order they were made: p_m (1 + relative_change s), s from -1/2 to 1/2.

Of another law than the dust's, what is calibrated of it drifts. p_m itself then is the strength in the middle of the series.
Scans are taken as made in the middle.
"""

from labsim.calibrated import scale_value
from labsim.effects import Normal, Parameter

title = "The strength drifts from drop to drop"
says = (
    "The samples grow weaker from the first to the last",
    "The samples grow stronger from the first to the last",
)
kind = "sample"
parameters = (
    Parameter(
        "relative_change",
        "1",
        null=0.0,
        limits=(-1.6, 1.6),
        prior=Normal(0.0, 0.3),
        step=0.2,
        symbol="δp_m/p_m",
        text="From the first drop to the last. Storage, humidity, charging or a slowly changing deposit machine alter "
        "strengths by tens of percent; more would be seen at once.",
    ),
)
leaves = "Residuals of the depth that follow the order of the drops and not speed or size."
remedy = "keep the samples alike: the same storage and deposit for all, drops in a mixed order"
references = ("Blum & Schräpler (2004): strength depends on preparation",)
expect = {"penetration_depth": -1}  # of the last drop


def applies(campaign):
    if len(campaign.drops) < 4:
        return f"only {len(campaign.drops)} drops; a drift needs at least 4"
    if len({drop.sequence for drop in campaign.drops}) < 4:
        return "the drops have no order (drop.sequence)"
    return ""


def change_setting(setting, values, place):
    factor = 1.0 + values["relative_change"] * place.sequence_fraction
    return setting.replace(material=scale_value(setting.material, factor))
