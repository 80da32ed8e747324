"""Gaussian likelihood of all tracks (and maps) of a campaign, with every error it is known to have.

    y = prediction(globals, nuisances) + noise,  covariance C = blocks of
        localisation (white, from the track), contact time (free), impact speed (free, tied to the stated height),
        surface row (stated), pixel and frame scale (stated or SCALE_SIGMA), sample scatter of ln p_m and stated mass error
        (a random ln p_m per drop), numerical error of the solver (smooth over fraction of the stop, depth and size).

Nuisances enter linearly about their current best values and are integrated out; globals (ln p_m, amplitudes) are
solved for by Gauss-Newton. Each term has a switch in Terms. Formulas: docs/inference.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..records import FloatArray
from .blocks import Block
from .drop_model import DropModel
from .drop_terms import DropTerms, NumericalError, Probe, Terms, linearise_drop


@dataclass(frozen=True)
class Linearised:
    """All drops about one point. residual : (n,); noise : (n, n); tangents : name -> (n,); sections : drop -> slice."""

    residual: FloatArray
    covariance: FloatArray
    tangents: dict[str, FloatArray]
    sections: dict[str, slice]
    local: list[FloatArray]  # per drop, (points, nuisances) scaled by their prior widths
    pulls: list[FloatArray]  # per drop, current nuisances over prior widths
    scans: tuple[Block, ...] = ()  # maps
    undisturbed: tuple[Block, ...] = ()  # dust that no bead reached, all scans in one

    @cached_property
    def drops(self) -> Block:
        """All drops, which share errors."""
        return Block(self.residual, self.covariance, self.tangents)

    @property
    def blocks(self) -> list[Block]:
        """The independent parts: all drops, then each map, then the undisturbed dust."""
        return [self.drops, *self.further]

    @property
    def further(self) -> list[Block]:
        """All parts but the drops."""
        return [*self.scans, *self.undisturbed]


def linearise(
    models: Sequence[DropModel], log_p_m: float, nominal: Probe, terms: Terms, probes: Mapping[str, Probe]
) -> Linearised:
    """Residuals, covariance and tangents of all drops.

    nominal : amplitudes, instruments and offsets at the point itself; probes : name of a global -> those after a step of it, for
    the tangents by finite differences.
    """
    parts = [linearise_drop(model, log_p_m, nominal, terms, probes) for model in models]
    ends = np.cumsum([part.residual.size for part in parts])
    sections = {
        model.observed.name: slice(int(end) - part.residual.size, int(end))
        for model, part, end in zip(models, parts, ends, strict=True)
    }
    return Linearised(
        np.concatenate([part.residual for part in parts]),
        _add_errors(parts, list(sections.values())),
        {name: np.concatenate([part.tangents[name] for part in parts]) for name in ("ln_p_m", *probes)},
        sections,
        [part.local for part in parts],
        [part.pull for part in parts],
    )


def _add_errors(parts: Sequence[DropTerms], sections: Sequence[slice]) -> FloatArray:
    """Covariance (n, n) of all drops: each one's own, what they share, the solver's."""
    covariance = numerical_covariance([part.numerical for part in parts])
    for part, own in zip(parts, sections, strict=True):
        covariance[own, own] += part.local @ part.local.T + np.diag(part.white)
    shared = {name: None for part in parts for name in part.shared}
    columns = np.zeros((len(covariance), len(shared)))
    for k, name in enumerate(shared):
        for part, own in zip(parts, sections, strict=True):
            if name in part.shared:
                columns[own, k] = part.shared[name]
    covariance += columns @ columns.T
    return covariance


def numerical_covariance(parts: Sequence[NumericalError]) -> FloatArray:
    """The solver's error of the depth: as large as terms.numerical of the depth reached, alike for alike drops."""
    size = np.concatenate([part.size for part in parts])
    fraction = np.concatenate([part.fraction for part in parts])
    apart = np.zeros((len(parts), len(parts)))  # the same for all points of two drops
    for name, scale in (("reach", 0.8), ("radius", 2.0), ("mass", 1.5)):
        value = np.array([getattr(part, name) for part in parts])
        apart += (np.subtract.outer(value, value) / scale) ** 2
    counts = [part.size.size for part in parts]
    distance = np.subtract.outer(fraction, fraction) / 0.4
    distance *= distance
    distance += np.repeat(np.repeat(apart, counts, axis=0), counts, axis=1)
    return np.asarray(np.outer(size, size) * np.exp(-0.5 * distance))


def solve_globals(
    blocks: Sequence[Block], names: Sequence[str], priors: Mapping[str, tuple[float, float]]
) -> tuple[FloatArray, FloatArray, float, float, list[FloatArray]]:
    """Step of the globals (k,), their covariance, χ² left, ln det C, and C⁻¹ (residual - tangents step) per block.

    priors: name -> (distance of the current value from the prior's middle, prior width); flat where absent.
    """
    information, gradient = np.zeros((len(names), len(names))), np.zeros(len(names))
    designs, log_determinant = [], 0.0
    for block in blocks:
        design = np.stack([block.tangents[name] for name in names], axis=1)
        solved = block.solve(design)
        information += design.T @ solved
        gradient += solved.T @ block.residual
        log_determinant += block.log_determinant
        designs.append(design)
    for k, name in enumerate(names):
        if name in priors:
            away, width = priors[name]
            information[k, k] += 1 / width**2
            gradient[k] -= away / width**2
    covariance = np.linalg.inv(information)
    step = covariance @ gradient
    chi_square, weighted = 0.0, []
    for block, design in zip(blocks, designs, strict=True):
        left = block.residual - design @ step
        weighted.append(block.solve(left))
        chi_square += float(left @ weighted[-1])
    return step, covariance, chi_square, log_determinant, weighted


def update_nuisances(models: Sequence[DropModel], linear: Linearised, weighted: FloatArray) -> float:
    """Move each drop's nuisances to their conditional best values; return the largest move in prior widths
    (contact time in units of a frame)."""
    moves = [0.0]
    for model, local in zip(models, linear.local, strict=True):
        best = (
            local.T @ weighted[linear.sections[model.observed.name]]
        )  # in prior widths, about their middles
        moves.append(model.move(best))
    return max(moves)
