"""One static strength test: whether its rows are those of one sample that gets stronger as it gets denser."""

from __future__ import annotations

import math

import numpy as np
from scipy.stats import chi2

from ..records import Campaign, StrengthTest
from .found import ODD, Found

LEAST_ROWS = 6  # below, a curve through the rows says nothing of their scatter
CHANCE = 1e-3  # of a scatter as large, below which the stated error is too small


def inspect_strength_test(test: StrengthTest, campaign: Campaign) -> Found:
    phi, stress = np.array(sorted(test.points)).T
    found = Found(
        f"strength/{test.name}",
        f"{test.kind.replace('_', ' ')}, {phi.size} rows, filling factor {phi[0]:.3f} to {phi[-1]:.3f}, "
        f"{stress.min() / 1e3:.3g} to {stress.max() / 1e3:.3g} kPa ± {100 * test.relative_sigma:.3g} %",
        {
            "filling_factor": [float(phi[0]), float(phi[-1])],
            "stress_Pa": [float(stress.min()), float(stress.max())],
        },
    )
    fall = (np.maximum.accumulate(np.log(stress)) - np.log(stress)).max()
    if fall > 2 * ODD * math.sqrt(2) * test.relative_sigma:
        found.odd.append(
            f"the stress falls by {100 * (1 - math.exp(-fall)):.0f} % while the dust gets denser: an unloading, or another "
            "sample; leave those rows out"
        )
    elif phi.size >= LEAST_ROWS and np.ptp(phi) > 1e-3:
        curve = np.polynomial.Polynomial.fit(phi, np.log(stress), min(4, phi.size - 3))
        left = np.log(stress) - curve(phi)
        free = phi.size - curve.degree() - 1
        scatter = math.sqrt(left @ left / free)
        if chi2.sf(left @ left / test.relative_sigma**2, free) < CHANCE:
            found.odd.append(
                f"rows scatter by {100 * scatter:.2g} % about a smooth curve, relative_sigma says "
                f"{100 * test.relative_sigma:.2g} %"
            )
    material = campaign.material
    if test.kind in ("compression_omnidirectional", "shear"):
        outside = int(np.sum((phi <= material.phi_1) | (phi >= material.phi_2)))
        if outside:
            found.odd.append(
                f"{outside} rows lie outside phi_1 = {material.phi_1:g} to phi_2 = {material.phi_2:g} of campaign.toml, where "
                "the law has no strength; labsim strength finds both"
            )
    return found
