"""One CT scan, reduced: whether its dust is what campaign.toml states."""

from __future__ import annotations

import math

from ..ct.reduce import reduce_scan
from ..errors import LabsimError
from ..records import Campaign, Scan
from .found import ODD, Found

GREY_SHARE = 0.005  # relative, of a filling factor whose grey calibration has no stated error


def inspect_scan(scan: Scan, campaign: Campaign) -> Found:
    stated = campaign.sample
    try:
        reduced = reduce_scan(scan, sample_filling_factor=stated.filling_factor)
    except LabsimError as trouble:
        return Found(scan.name, "no map can be made", trouble=trouble)
    phi = reduced.undisturbed
    found = Found(
        scan.name,
        f"{2e3 * scan.projectile.tip_radius:.3g} mm bead, tip {reduced.map.tip_depth * 1e3:.3f} mm deep, undisturbed dust of "
        f"filling factor {phi.value:.5f} ± {phi.sigma:.5f}",
        {"filling_factor_undisturbed": phi.value, "tip_depth_m": reduced.map.tip_depth},
        list(reduced.map.warnings),
    )
    sigma = math.hypot(phi.sigma, stated.filling_factor_sigma, GREY_SHARE * stated.filling_factor)
    if abs(phi.value - stated.filling_factor) > ODD * sigma:
        found.odd.append(
            f"the undisturbed dust has filling factor {phi.value:.4f}, but campaign.toml states {stated.filling_factor:g} ± "
            f"{stated.filling_factor_sigma:g}; check the grey calibration or sample.filling_factor"
        )
    return found
