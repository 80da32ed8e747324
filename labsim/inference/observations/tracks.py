"""All drops of a campaign as one part of the data, with every error they are known to have.

    y = prediction(globals, nuisances) + noise,  covariance C = blocks of
        localisation (white, from the track), contact time (free), impact speed (free, tied to the stated height),
        surface row (stated), pixel and frame scale (stated or SCALE_SIGMA), sample scatter of ln p_m and stated mass error
        (a random ln p_m per drop), numerical error of the solver (smooth over fraction of the stop, depth and size).

Nuisances enter linearly about their current best values and are integrated out. Each term has a switch in ErrorBudget. Formulas:
docs/likelihood-errors.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...records import FloatArray
from ..emulation.forward import Instant
from ..fits.blocks import Block, add_errors, lay_out
from . import RunFeatures
from .drop_model import REACH, WIDTHS
from .linearised_drop import (
    ErrorBudget,
    NumericalError,
    Perturbation,
    RecordModel,
    linearise_drop,
    measure_distances,
)

MOST_APART = 4.0  # standard deviations that a sample may be from the others


@dataclass(frozen=True)
class DropsBlock(Block):
    """All drops about one point, each a section. local : per drop, (points, nuisances) scaled by their prior widths; scatters :
    of ln p_m of each sample, 0 where other records have it in common."""

    local: tuple[FloatArray, ...] = ()
    scatters: tuple[float, ...] = ()


@dataclass(frozen=True)
class Tracks:
    """All drops that are compared, an Observation. models : one a drop; features : of one projectile each.

    Nuisances : (drops, 4) contact time (s), ln of the impact speed, offset of the surface row (m), of ln p_m of the sample:
    a drop into dust a quarter weaker than the others is no straight line in ln p_m.
    """

    models: tuple[RecordModel, ...]
    features: tuple[RunFeatures, ...]
    kind: str = "drops"
    name: str = "drops"

    def begin(self) -> FloatArray:
        return np.array([model.start for model in self.models])

    def instants(self, nuisances: FloatArray) -> list[Instant]:
        """Nuisances by name, one record a drop."""
        return [Instant(*map(float, row)) for row in nuisances]

    @property
    def samples(self) -> dict[str, list[str]]:
        """Names of the records of each drop: one, or one an instrument."""
        found: dict[str, list[str]] = {}
        for model in self.models:
            found.setdefault(model.observed.drop.sample, []).append(model.observed.name)
        return found

    def linearise(
        self,
        nuisances: FloatArray,
        log_p_m: float,
        nominal: Perturbation,
        budget: ErrorBudget,
        perturbations: Mapping[str, Perturbation],
    ) -> DropsBlock:
        samples = self.samples
        parts = [
            linearise_drop(
                model,
                instant,
                log_p_m,
                nominal,
                budget,
                perturbations,
                with_others=len(samples[model.observed.drop.sample]) > 1,
            )
            for model, instant in zip(self.models, self.instants(nuisances), strict=True)
        ]
        places = lay_out(part.residual.size for part in parts)
        sections = {model.observed.name: place for model, place in zip(self.models, places, strict=True)}
        covariance = numerical_covariance([part.numerical for part in parts])
        add_errors(covariance, parts, places)
        return DropsBlock(
            np.concatenate([part.residual for part in parts]),
            covariance,
            {
                name: np.concatenate([part.tangents[name] for part in parts])
                for name in ("ln_p_m", *perturbations)
            },
            sections=sections,
            local=tuple(part.local for part in parts),
            scatters=tuple(part.scatter for part in parts),
        )

    def keep_strengths(self, nuisances: FloatArray, block: Block, change: float) -> FloatArray:
        """The nuisances where ln p_m is another by ``change`` and each sample keeps the strength that its own drop shows."""
        assert isinstance(block, DropsBlock)
        kept = nuisances.copy()
        kept[:, 3] -= change * (np.array(block.scatters) > 0.0)
        return kept

    def follow(self, nuisances: FloatArray, block: Block, weighted: FloatArray) -> tuple[FloatArray, float]:
        assert isinstance(block, DropsBlock)
        moved, moves = [], [0.0]
        for model, instant, local, scatter in zip(
            self.models, self.instants(nuisances), block.local, block.scatters, strict=True
        ):
            # in prior widths, about their middles
            best = local.T @ weighted[block.sections[model.observed.name]]
            after, move = model.move(instant, best, WIDTHS)
            if scatter > 0.0:
                strength = float(np.clip(best[3], -MOST_APART, MOST_APART)) * scatter
                after = after._replace(strength=strength)
                move = max(move, 100 * abs(strength - instant.strength))
            moved.append(after)
            moves.append(move)
        return np.array(moved), max(moves)


def numerical_covariance(parts: Sequence[NumericalError]) -> FloatArray:
    """The solver's error of the depth: as large as budget.numerical of the depth reached, alike for alike drops."""
    size = np.concatenate([part.size for part in parts])
    fraction = np.concatenate([part.fraction / part.length for part in parts])
    counts = [part.size.size for part in parts]
    distance = np.subtract.outer(fraction, fraction)
    distance *= distance
    apart = measure_distances([(part.reach * REACH / part.changes, part.radius, part.mass) for part in parts])
    # a depth and an acceleration are not off alike
    unit = np.array([part.unit for part in parts])
    apart += np.where(np.not_equal.outer(unit, unit), 1e4, 0.0)
    distance += np.repeat(np.repeat(apart, counts, axis=0), counts, axis=1)
    return np.asarray(np.outer(size, size) * np.exp(-0.5 * distance))
