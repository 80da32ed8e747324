"""The grey-to-density factor of the CT is off: filling factors read from it are true ones times this factor."""

from labsim.effects import Normal, Parameter

title = "The grey-to-density factor of the CT is off"
says = ("The scanner's grey levels read too low", "The scanner's grey levels read too high")
kind = "measurement"
parameters = (
    Parameter(
        "factor",
        "1",
        null=1.0,
        limits=(0.6, 1.6),
        prior=Normal(1.0, 0.05),
        step=0.03,
        symbol="grey/grey0",
        text="True over stated grey level per density. Beam hardening, drift of the tube and the choice of the reference "
        "material move calibrations by a few percent.",
    ),
)
leaves = "Undisturbed dust in the scans has another filling factor than the sample, and the compacted volume follows."
remedy = (
    "calibrate the grey levels of the scanner again: filling factors read with them are {value:.3f} "
    "times the true ones"
)
references = ("Bright, dark and known-density calibration of X-ray attenuation",)
expect = {"compacted_volume": 1, "penetration_depth": 0}


def applies(campaign):
    return "" if campaign.scans else "there is no CT scan with slices"


def change_instrument(instrument, values, place):
    return instrument.replace(ct_scale=instrument.ct_scale * values["factor"])
