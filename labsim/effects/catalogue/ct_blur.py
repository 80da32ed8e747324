"""The point spread of the CT is wider than one voxel: the standard deviation of its Gaussian is larger by so much.

It is a difference of widths. A second Gaussian in quadrature would change the width by nothing to first order, by which causes
are screened.
"""

from labsim.effects import HalfNormal, Parameter

title = "The CT's point spread is wider than assumed"
kind = "measurement"


def parameters(campaign):
    voxel = max((scan.voxel for scan in campaign.scans), default=2.0e-5)
    return (
        Parameter(
            "sigma",
            "m",
            null=0.0,
            limits=(0.0, 10.0 * voxel),
            prior=HalfNormal(2.0 * voxel),
            step=1.0 * voxel,
            symbol="σ",
            text="Focal spot, motion and reconstruction filters add one or two voxels each.",
        ),
    )


leaves = "The edge of the bead is soft, and the densest dust next to it is smeared into the halo; volumes are kept."
remedy = "measure the scanner's point spread, on the edge of the bead"
references = ("A Gaussian point spread, fitted to the edge of the bead",)
expect = {"penetration_depth": 0}


def applies(campaign):
    return "" if campaign.scans else "there is no CT scan with slices"


def change_instrument(instrument, values, place):
    return instrument.replace(ct_blur=instrument.ct_blur + values["sigma"])
