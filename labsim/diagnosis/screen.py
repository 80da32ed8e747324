"""Which effects could explain what the nominal fit leaves? Score tests on whitened, projected tangents.

Input: a Workbench and the nominal Fit. Output: a Screening with, for every effect, how far its fingerprint (the tangent after
ln p_m and all nuisances are taken out) lies along the residual, what amplitude that asks for, and how alike the
fingerprints are. Formulas: docs/diagnosis.md; Rao's score test, linear Gaussian Bayes factor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..inference.fitting import Fit, with_probes
from ..inference.nodes import amplitude_nodes, screening_node
from ..inference.workbench import Workbench
from ..records import FloatArray

DRAWS = 20_000
CONFUSABLE = 0.9  # cosine of fingerprints
CLOSE = 30.0  # ln Bayes factors within which a screened effect is re-simulated


@dataclass(frozen=True)
class Score:
    """One effect about null. score : standard normal under the nominal model; signal : length of the fingerprint per unit
    amplitude; amplitude : what the score asks for; log_bayes : ln Bayes factor against the nominal model, linear."""

    name: str
    score: float
    signal: float
    amplitude: float
    log_bayes: float


@dataclass(frozen=True)
class Screening:
    """scores, best first; cosines : (k, k) between fingerprints in the order of ``names``; p_value of the largest score;
    residual, fingerprints : whitened, projected."""

    scores: list[Score]
    names: list[str]
    cosines: FloatArray
    p_value: float
    residual: FloatArray
    fingerprints: FloatArray


def screen(bench: Workbench, fit: Fit, rng: np.random.Generator, names: list[str] | None = None) -> Screening:
    """Tangents of all effects at the nominal fit (runs at one amplitude and one p_m each) and their scores."""
    names = [name for name in (names or bench.effects) if bench.effects[name].amplitudes]
    index = screening_node(fit.log_p_m)
    wanted = [
        (name, amplitude, index)
        for name in names
        if bench.costs_runs(name)
        for amplitude in amplitude_nodes(bench.effects[name], 0.0)
    ]
    bench.require_changes(wanted, "fingerprints", coarse=True)
    names = [name for name in names if not bench.costs_runs(name) or has_runs(bench, name)]
    linear = with_probes(bench, fit, names)
    whitened = np.concatenate(
        [
            block.whiten(
                np.stack([block.residual, *(block.tangents[name] for name in ("ln_p_m", *names))], axis=1)
            )
            for block in linear.blocks
        ]
    )
    direction = whitened[:, 1] / np.linalg.norm(whitened[:, 1])
    projected = whitened - np.outer(direction, direction @ whitened)
    residual, fingerprints = projected[:, 0], projected[:, 2:]
    lengths = np.linalg.norm(fingerprints, axis=0)
    usable = lengths > 1e-9
    names = [name for name, ok in zip(names, usable, strict=True) if ok]
    fingerprints, lengths = fingerprints[:, usable], lengths[usable]
    unit = fingerprints / lengths
    z = unit.T @ residual
    scores = []
    for k, name in enumerate(names):
        width = bench.effects[name].amplitudes[0].scale
        snr = (lengths[k] * width) ** 2
        log_bayes = 0.5 * z[k] ** 2 * snr / (1 + snr) - 0.5 * math.log1p(snr)
        log_bayes += bench.shape_evidence.get(name, 0.0)
        scores.append(Score(name, float(z[k]), float(lengths[k]), float(z[k] / lengths[k]), float(log_bayes)))
    cosines = unit.T @ unit
    largest = float(np.max(z**2)) if len(z) else 0.0
    root = np.linalg.cholesky(cosines + 1e-9 * np.eye(len(z)))
    null = np.max((rng.standard_normal((DRAWS, len(z))) @ root.T) ** 2, axis=1)
    p_value = float((np.sum(null >= largest) + 1) / (DRAWS + 1))
    scores.sort(key=lambda score: -score.log_bayes)
    return Screening(scores, names, cosines, p_value, residual, fingerprints)


def screen_pairs(bench: Workbench, screening: Screening) -> list[tuple[tuple[str, str], float]]:
    """ln Bayes factors of all pairs against the nominal model, linear, best first."""
    widths = np.array([bench.effects[name].amplitudes[0].scale for name in screening.names])
    columns = screening.fingerprints * widths
    gram, towards = columns.T @ columns, columns.T @ screening.residual
    found = []
    for i, first in enumerate(screening.names):
        for j in range(i + 1, len(screening.names)):
            own = np.ix_((i, j), (i, j))
            information = gram[own] + np.eye(2)
            pull = towards[[i, j]]
            log_bayes = (
                0.5 * pull @ np.linalg.solve(information, pull) - 0.5 * np.linalg.slogdet(information)[1]
            )
            found.append(((first, screening.names[j]), float(log_bayes)))
    return sorted(found, key=lambda item: -item[1])


def has_runs(bench: Workbench, name: str) -> bool:
    """Whether an effect's runs gave every projectile something to compare."""
    tables = [*bench.tables, *(scan.table for scan in bench.scans)]
    return all(
        any(entry for entry in (table.changes.get(name) or table.fingerprints.get(name, {})).values())
        for table in tables
    )


def list_confusable(screening: Screening) -> list[tuple[str, str, float]]:
    """Pairs whose fingerprints are nearly parallel in this campaign, known before any data are looked at."""
    found = []
    for i, first in enumerate(screening.names):
        for j in range(i + 1, len(screening.names)):
            cosine = float(screening.cosines[i, j])
            if abs(cosine) > CONFUSABLE:
                found.append((first, screening.names[j], cosine))
    return sorted(found, key=lambda item: -abs(item[2]))
