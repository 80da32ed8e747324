"""The hypothesis that something is wrong which no listed cause explains: a smooth force law without a name.

It competes with the causes on equal terms: residuals are a Gaussian process, orthogonal to nothing, whose size is
integrated over a few values. What may deviate stands in FREEDOMS: a force law smooth over the way into the dust, speed and size;
every drop by its own offset; the layering of undisturbed dust. Where the nominal model may fail, a camera that wobbles competes
too, and formulas that cost no runs, together as one freedom; where it fails, laws that stand in the equations of motion
(EMBEDDED, free_law.py): what these find is drawn as the shape of what is missing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ...effects.terms import list_terms
from ...inference.fits.blocks import Block, solve_globals
from ...inference.fits.evidence import log_share_inside
from ...inference.fits.fitting import DOUBTFUL, Fit, fit_p_value
from ...inference.problem import Problem
from ...records import FloatArray
from .free_law import EMBEDDED, RecoveredLaw, Tangents, average, choose_hats, log_mean, weigh_freedoms
from .free_law import SIZES as LAW_SIZES
from .hats import fit_without_runs
from .wobble import Wobble, fit_wobble

SIZES = (0.01, 0.02, 0.04, 0.08)  # of the depth
MAP_SHARE = 3.0  # a law that changes depths by 1 % may change the contrast of the map, or the undisturbed dust, by 3 %


DUST, WOBBLE = "undisturbed dust", "a camera that wobbles"


@dataclass(frozen=True)
class Freedom:
    """What may deviate. scales : of the law over (fraction of the way, ln speed, ln size), None where drops may not deviate;
    kinds : of the other observations that may."""

    scales: tuple[float, float, float] | None
    kinds: frozenset[str]


FREEDOMS = {
    "depth and speed": Freedom((0.35, 0.5, 0.5), frozenset({"map"})),
    "drop": Freedom((1.0, 1e-3, 1e-3), frozenset({"map"})),
    "undisturbed dust": Freedom(None, frozenset({DUST})),
    "depth and speed and undisturbed dust": Freedom((0.35, 0.5, 0.5), frozenset({"map", DUST})),
}


@dataclass(frozen=True)
class UnknownFit:
    """evidence : ln of the integrated likelihood; block, size : the best; law : (n,) posterior mean per datum of the drops, m.

    evidences : of every freedom, over its sizes; laws : what the data say of the laws of the best freedom that stands in the
    equations, ``embedded``; empty where none was tried. tangents : of all hats, where embedded laws were tried. wobble : of the
    camera, where the nominal model may fail. beside : ln Bayes factor of a free law on top of the best listed cause over that
    cause alone; minus infinity where that was not asked.
    """

    evidence: float
    block: str
    size: float
    law: FloatArray
    evidences: dict[str, float]
    embedded: str = ""
    laws: tuple[RecoveredLaw, ...] = ()
    tangents: Tangents | None = None
    wobble: Wobble | None = None
    beside: float = -math.inf

    def find_wobble(self, nominal: Fit) -> Wobble | None:
        """The camera's wobble, where that alone explains the data."""
        leads = self.block == WOBBLE and self.wobble is not None and self.wobble.explains(nominal)
        return self.wobble if leads else None


def fit_unknown(problem: Problem, fit: Fit, tangents: Tangents | None = None) -> UnknownFit:
    """Evidence of the nominal model plus a free law, at the nominal linearisation.

    tangents : of embedded laws, where those compete.
    """
    drops, kinds = fit.drops, [each.kind for each in problem.observations]
    coordinates = law_coordinates(problem, fit)
    low, high = (math.log(p) for p in problem.campaign.p_m_range)
    n = sum(block.residual.size for block in fit.blocks)
    terms: dict[str, list[float]] = {}
    best: tuple[float, str, float, FloatArray] | None = None
    changes = [block.free() if block.free is not None else None for block in fit.blocks[1:]]
    for name, freedom in FREEDOMS.items():
        if DUST in freedom.kinds and DUST not in kinds:
            continue
        shape = law_covariance(coordinates, freedom.scales) if freedom.scales else None
        for size in SIZES:
            free = [inflate(drops, shape, size)]
            free += [
                inflate(block, change if kind in freedom.kinds else None, MAP_SHARE * size)
                for kind, block, change in zip(kinds[1:], fit.blocks[1:], changes, strict=True)
            ]
            step, variance, chi, logdet, weighted = solve_globals(free, ["ln_p_m"], {})
            evidence = -0.5 * (chi + logdet + n * math.log(2 * math.pi))
            evidence += 0.5 * math.log(2 * math.pi) + 0.5 * math.log(variance[0, 0]) - math.log(high - low)
            moved = fit.log_p_m + float(step[0])
            evidence += log_share_inside(low, high, moved, math.sqrt(variance[0, 0]))
            terms.setdefault(name, []).append(evidence)
            if best is None or evidence > best[0]:
                law = size**2 * shape @ weighted[0] if shape is not None else np.zeros(drops.residual.size)
                best = (evidence, name, size, law)
    formulas = fit_without_runs(problem, fit) if fit_p_value(fit) < DOUBTFUL else {}
    if formulas:
        term, found = max(formulas.items(), key=lambda item: item[1].evidence)
        terms[list_terms()[term].title] = [each.evidence for each in formulas.values()]
        if best is None or found.evidence > best[0]:
            best = (found.evidence, list_terms()[term].title, 0.0, drops.residual - found.drops.residual)
    wobble = fit_wobble(problem, fit) if fit_p_value(fit) < DOUBTFUL else None
    if wobble is not None:
        terms[WOBBLE] = wobble.evidences.tolist()
        if best is None or wobble.evidences.max() > best[0]:
            best = (float(wobble.evidences.max()), WOBBLE, 0.0, wobble.law)
    embedded: dict[str, tuple[RecoveredLaw, ...]] = {}
    if tangents is not None:
        for name, each in weigh_freedoms(tangents, (low, high)).items():
            own = [law for law in tangents.laws if law.name in EMBEDDED[name] and law.knots]
            terms[name] = [one.evidence for one in each]
            embedded[name], mean = average(own, each)
            top = max(each, key=lambda one: one.evidence)
            if best is None or top.evidence > best[0]:
                drawn = tangents.of_drops(choose_hats(tangents, name)) @ mean[1:]
                best = (top.evidence, name, LAW_SIZES[each.index(top)], drawn)
    assert best is not None
    evidences = {name: log_mean(values) for name, values in terms.items()}
    nearest = max(embedded, key=lambda name: evidences[name], default="")
    laws = embedded.get(nearest, ())
    return UnknownFit(log_mean(evidences.values()), *best[1:], evidences, nearest, laws, tangents, wobble)


def inflate(block: Block, free: FloatArray | None, size: float) -> Block:
    """The block with a free covariance, of this size, among its errors."""
    return block if free is None else replace(block, covariance=block.covariance + size**2 * free)


def law_coordinates(problem: Problem, fit: Fit) -> dict[str, FloatArray]:
    """Per datum: depth reached (m; of an accelerometer the acceleration, m/s²), fraction of the way,
    ln of speed² over radius, ln radius, ln mass per radius³."""
    parts: dict[str, list[FloatArray]] = {
        "reached": [],
        "fraction": [],
        "speed": [],
        "radius": [],
        "mass": [],
    }
    tracks = problem.tracks
    for model, instant in zip(tracks.models, tracks.instants(fit.nuisances[0]), strict=True):
        section = fit.drops.sections[model.observed.name]
        n = section.stop - section.start
        reached = np.zeros(n)
        count = model.data.size
        reached[:count] = model.size(model.data - fit.drops.residual[section][:count])
        fraction = np.zeros(n)
        fraction[: model.way.size] = model.way
        parts["reached"].append(reached)
        parts["fraction"].append(fraction)
        mass = model.observed.drop.projectile.mass
        for key, value in (
            ("speed", instant.log_speed - 0.5 * math.log(model.radius)),
            ("radius", math.log(model.radius)),
            ("mass", math.log(mass / model.radius**3)),
        ):
            parts[key].append(np.full(n, value))
    return {key: np.concatenate(values) for key, values in parts.items()}


def law_covariance(at: dict[str, FloatArray], scales: tuple[float, float, float]) -> FloatArray:
    """Unit-size covariance, m², of a law smooth over (fraction of the way, speed, size and mass)."""
    along, speed, size = scales
    distance = (
        (np.subtract.outer(at["fraction"], at["fraction"]) / along) ** 2
        + (np.subtract.outer(at["speed"], at["speed"]) / speed) ** 2
        + (np.subtract.outer(at["radius"], at["radius"]) / size) ** 2
        + (np.subtract.outer(at["mass"], at["mass"]) / (2 * size)) ** 2
    )
    return np.outer(at["reached"], at["reached"]) * np.exp(-0.5 * distance)
