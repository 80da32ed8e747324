"""The gauge has not yet the temperature of the ground, and its zero is off: by shift · exp(-t/time), t since the push began.

A fast push is over before the gauge has cooled, a slow one is not: this looks like a strength that grows with the rate.
"""

from labsim.effects import LogNormal, Normal, Parameter

title = "The gauge's zero drifts while it takes the temperature of the ground"
says = (
    "The gauge reads too little until it has the temperature of the ground",
    "The gauge reads too much until it has the temperature of the ground",
)
kind = "measurement"
parameters = (
    Parameter(
        "shift",
        "Pa",
        null=0.0,
        limits=(-2.0e5, 2.0e5),
        prior=Normal(0.0, 2.0e4),
        step=1.0e4,
        symbol="q(0)",
        text="Of the resistance at the start. Zeros of cones move by some kPa a kelvin, and ground and air differ by 5 to 15 K.",
    ),
    Parameter(
        "time",
        "s",
        null=300.0,
        limits=(10.0, 1.0e4),
        prior=LogNormal(300.0, 0.7),
        step=100.0,
        shape=True,
        symbol="τ",
        text="A steel cone of 36 mm in wet ground follows in some minutes.",
    ),
)
leaves = "Fast pushes read higher, or lower, than slow ones: the same pressure in weak and in strong ground, less with depth."
remedy = (
    "let the gauge take the temperature of the ground before the push, and note its zero before and after"
)
references = ("Lunne, Robertson & Powell (1997), Cone Penetration Testing: temperature of the sensor",)
expect: dict[str, int] = {}


def applies(campaign):
    pushed = [drop for drop in campaign.drops if drop.motion.kind == "pushed" and drop.gauge is not None]
    speeds = {dict(drop.motion.values).get("speed") for drop in pushed}
    return "" if len(speeds) > 1 else "there are no force records at two speeds"


def change_instrument(instrument, values, place):
    if values["shift"] == 0.0:
        return instrument
    return instrument.replace(gauge_shift=instrument.gauge_shift + values["shift"], gauge_time=values["time"])
