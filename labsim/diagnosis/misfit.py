"""Where a fit misses the data: which records, which maps and which part of them.

χ² of an observation counts with its own errors, shared ones included; that of one drop among others, with all that it shares
taken as its own. Small p values are rare for a true model.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from ..inference.fits.blocks import Block
from ..inference.fits.fitting import DOUBTFUL, Fit, rate_block
from ..inference.observations.compacted_zone import CompactedZone, CompactedZones
from ..inference.problem import Problem
from ..records import FloatArray

CLEAR = 3.0  # standard deviations of the mean of a region from which it is named


@dataclass(frozen=True)
class Region:
    """A part of a map: measured minus simulated filling factor, mean over its cells, and its standard deviation."""

    name: str
    excess: float
    sigma: float


@dataclass(frozen=True)
class Part:
    """One observation, or one record or map of several. sections : these; regions : of a map, the clearest first."""

    name: str
    kind: str
    chi_square: float
    points: int
    p_value: float
    regions: tuple[Region, ...] = ()
    sections: tuple[Part, ...] = ()

    @property
    def missed(self) -> bool:
        return self.p_value < DOUBTFUL


def measure_misfit(problem: Problem, fit: Fit) -> list[Part]:
    """Every observation, with every drop and map by itself."""
    parts = []
    for observation, block in zip(problem.observations, fit.blocks, strict=True):
        sections = []
        for name, section in block.sections.items():
            own = Block(block.residual[section], block.covariance[section, section], {})
            regions: tuple[Region, ...] = ()
            spent = 2  # contact time and speed of a drop
            if isinstance(observation, CompactedZones):
                zone = next(each for each in observation.zones if each.name == name)
                regions, spent = compare_regions(zone, own.residual, own.covariance), 0
            p_value = float(chi2.sf(own.chi_square, max(own.residual.size - spent, 1)))
            kind = observation.kind.removesuffix("s")
            sections.append(Part(name, kind, own.chi_square, own.residual.size, p_value, regions))
        p_value = rate_block(block, fit.hypothesis)
        parts.append(
            Part(
                observation.name,
                observation.kind,
                block.chi_square,
                block.residual.size,
                p_value,
                sections=tuple(sections),
            )
        )
    return parts


def compare_regions(zone: CompactedZone, residual: FloatArray, covariance: FloatArray) -> tuple[Region, ...]:
    """What is left of a map under the tip, beside the bead, and above the level of the tip, the clearest first.

    residual : (n + 1,) of the cells and the tip's depth; covariance : of both.
    """
    observed = zone.observed
    found, radius = observed.map, observed.radius
    r, z = (grid[observed.cells] for grid in np.meshgrid(found.r, found.z))
    below = z < -found.tip_depth
    regions = {
        "under the tip": below & (r < radius),
        "below, to the side": below & (r >= radius),
        "beside the bead": ~below,
    }
    rated = []
    for name, cells in regions.items():
        if cells.any():
            weight = np.append(cells / cells.sum(), 0.0)
            sigma = math.sqrt(float(weight @ covariance @ weight))
            rated.append(Region(name, float(weight @ residual), sigma))
    return tuple(sorted(rated, key=lambda each: -abs(each.excess) / each.sigma))


def say_misfit(parts: Sequence[Part]) -> str:
    """What is missed and what is met, in one sentence; empty where nothing is missed."""
    missed = [part for part in parts if part.missed]
    if not missed:
        return ""
    said = []
    for part in missed:
        text = f"{part.name} (χ² {part.chi_square:.0f} for {part.points} data"
        ranked = sorted(part.sections, key=lambda each: each.p_value)
        worst = [each.name for each in ranked if each.missed]
        if worst and len(ranked) > 1:
            text += f", most {', '.join(worst[:3])}"
        region = max(
            (region for each in ranked for region in each.regions),
            key=lambda each: abs(each.excess) / each.sigma,
            default=None,
        )
        if region is not None and abs(region.excess) > CLEAR * region.sigma:
            more = "denser" if region.excess > 0 else "looser"
            text += f", {abs(region.excess):.3f} {more} than simulated {region.name}"
        said.append(text + ")")
    met = [part.name for part in parts if not part.missed]
    return f"misses {', '.join(said)}" + (f"; it meets {', '.join(met)}" if met else "")
