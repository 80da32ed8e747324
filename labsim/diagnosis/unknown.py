"""The hypothesis that something is wrong which no listed cause explains: a smooth force law without a name.

It competes with the causes on equal terms: residuals are a Gaussian process, orthogonal to nothing, whose size is
integrated over a few values. What it finds is drawn as the shape of what is missing. Blocks: ``depth and speed`` (a law
smooth over the way into the dust, speed and size), ``drop`` (every drop its own offset).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..inference.fitting import Fit, Workbench
from ..inference.likelihood import solve_globals
from ..inference.scans import Block
from ..records import FloatArray

MAP_SHARE = 3.0  # a law that changes depths by 1 % may change the contrast of the map by 3 %
SIZES = (0.01, 0.02, 0.04, 0.08)  # of the depth
BLOCKS = {"depth and speed": (0.35, 0.5, 0.5), "drop": (1.0, 1e-3, 1e-3)}


@dataclass(frozen=True)
class UnknownFit:
    """evidence : ln of the integrated likelihood; block, size : the best; law : (n,) posterior mean, m, per datum."""

    evidence: float
    block: str
    size: float
    law: FloatArray
    log_p_m: float
    log_p_m_sigma: float


def fit_unknown(bench: Workbench, fit: Fit) -> UnknownFit:
    """Evidence of the nominal model plus a free smooth law, at the nominal linearisation."""
    linear = fit.linear
    coordinates = law_coordinates(fit)
    low, high = (math.log(p) for p in bench.campaign.p_m_range)
    terms, best = [], None
    for block, scales in BLOCKS.items():
        shape = law_covariance(coordinates, scales)
        for size in SIZES:
            drops = Block(
                linear.residual, linear.covariance + size**2 * shape, linear.tangents, linear.residual * 0
            )
            scans = [free_map(block, MAP_SHARE * size) for block in linear.scans]
            step, information, chi, logdet, weighted = solve_globals([drops, *scans], ["ln_p_m"], {})
            n = sum(block.residual.size for block in linear.blocks)
            evidence = -0.5 * (chi + logdet + n * math.log(2 * math.pi))
            evidence += 0.5 * math.log(2 * math.pi) + 0.5 * math.log(information[0, 0]) - math.log(high - low)
            terms.append(evidence)
            if best is None or evidence > best[0]:
                law = size**2 * shape @ weighted[0]
                best = (
                    evidence,
                    block,
                    size,
                    law,
                    fit.log_p_m + float(step[0]),
                    math.sqrt(information[0, 0]),
                )
    assert best is not None
    top = max(terms)
    total = top + math.log(sum(math.exp(term - top) for term in terms) / len(terms))
    return UnknownFit(total, *best[1:])


def free_map(block: Block, share: float) -> Block:
    """A scan whose contrast is free within a share of itself, alike in all cells of like contrast."""
    free = share * block.free
    scale = max(float(block.free.max()), 1e-12)
    alike = np.exp(-0.5 * (np.subtract.outer(block.free, block.free) / (0.3 * scale)) ** 2)
    return Block(block.residual, block.covariance + np.outer(free, free) * alike, block.tangents, block.free)


def law_coordinates(fit: Fit) -> dict[str, FloatArray]:
    """Per datum: depth reached (m), fraction of the way, ln of speed² over radius, ln radius, ln mass per radius³."""
    parts: dict[str, list[FloatArray]] = {
        "reached": [],
        "fraction": [],
        "speed": [],
        "radius": [],
        "mass": [],
    }
    for model in fit.models:
        section = fit.linear.sections[model.observed.name]
        n = section.stop - section.start
        data = model.matrix @ model.observed.depth
        reached = np.zeros(n)
        reached[: data.size] = np.maximum(data, 0.0)
        final = reached.max()
        parts["reached"].append(reached)
        parts["fraction"].append(reached / final)
        mass = model.observed.drop.projectile.mass
        for key, value in (
            ("speed", model.instant.log_speed - 0.5 * math.log(model.radius)),
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
