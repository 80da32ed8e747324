"""Gaussian likelihood of all tracks (and maps) of a campaign, with every error it is known to have.

    y = prediction(globals, nuisances) + noise,  covariance C = blocks of
        localisation (white, from the track), contact time (free), impact speed (free, tied to the stated height),
        surface row (stated), pixel and frame scale (stated or SCALE_SIGMA), sample scatter of ln p_m and stated mass error
        (a random ln p_m per drop), numerical error of the solver (smooth over fraction of the stop, speed and size).

Nuisances enter linearly about their current best values and are integrated out; globals (ln p_m, amplitudes) are
solved for by Gauss-Newton. Each term has a switch in Terms. Formulas: docs/inference.md.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from ..effects import Instrument
from ..errors import ExtrapolationError
from ..records import FloatArray
from .blocks import Block
from .forward import Instant, ResponseTable, predict_depth, predict_speed
from .observe import STANDARD_GRAVITY, ObservedDrop

BIN = 8  # frames of free fall averaged into one point
FREE = 1.0e-3  # s, prior width of the contact time: as good as free
SPEED_SLACK = 0.002  # of the speed, beside the stated error of the height (guide, release)
# ln of speed over root of gravity and radius, where p_m makes up for all of the solver's error
USUAL_SWIFTNESS = 1.85
MASS_TO_STRENGTH = 3.0  # d ln p_m that mimics d ln m: D goes as m^0.9 and as p_m^-0.3


@dataclass(frozen=True)
class Terms:
    """Sizes of the error terms; zero switches one off."""

    scatter: float = 0.02  # of ln p_m from sample to sample
    pixel_scale: float = 0.001  # relative, common to all drops of one camera setting, where nothing is stated
    frame_scale: float = 0.0002
    contact_offset: float = 0.015  # numerical offset of the contact, in tip radii, common to all drops
    numerical: float = 0.004  # of the depth, smooth
    numerical_change: float = 0.03  # of what an effect changes of the depth, smooth
    numerical_strength: float = 0.02  # of ln p_m, common to all drops
    numerical_slope: float = 0.01  # of the depth, per e-fold of speed over √radius, common to all drops
    heights: bool = True


@dataclass
class DropModel:
    """One drop with its response table and current nuisances."""

    observed: ObservedDrop
    table: ResponseTable
    instant: Instant
    matrix: FloatArray  # averages free-fall frames: (points, frames)

    @property
    def radius(self) -> float:
        return self.observed.drop.projectile.tip_radius


def make_drop_model(observed: ObservedDrop, table: ResponseTable) -> DropModel:
    """Average the free fall in bins; start the nuisances from the track's own free-fall fit."""
    before = int(np.sum(observed.time < observed.contact_time - 2e-4))
    groups = [np.arange(k, min(k + BIN, before)) for k in range(0, before, BIN)]
    groups += [np.array([k]) for k in range(before, observed.time.size)]
    matrix = np.zeros((len(groups), observed.time.size))
    for row, members in enumerate(groups):
        matrix[row, members] = 1.0 / len(members)
    start = Instant(observed.contact_time, math.log(observed.impact_speed), 0.0)
    return DropModel(observed, table, start, matrix)


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

    @property
    def blocks(self) -> list[Block]:
        """The independent parts: all drops, then each map, then the undisturbed dust."""
        return [Block(self.residual, self.covariance, self.tangents), *self.further]

    @property
    def further(self) -> list[Block]:
        """All parts but the drops."""
        return [*self.scans, *self.undisturbed]


Globals = Mapping[str, float]


def linearise(
    models: Sequence[DropModel],
    log_p_m: float,
    amplitudes: Mapping[str, float],
    instruments: Mapping[str, Instrument],
    log_offsets: Mapping[str, float],
    terms: Terms,
    probes: Mapping[str, tuple[Mapping[str, float], Mapping[str, Instrument], Mapping[str, float], float]],
) -> Linearised:
    """Residuals, covariance and tangents of all drops.

    amplitudes: of effects that cost runs; instruments and log_offsets (of ln p_m): per drop, by name.
    probes: name -> (amplitudes, instruments, log_offsets, step): finite differences for the tangents of globals.
    """
    residuals, noises, local, pulls, sections = [], [], [], [], {}
    tangents: dict[str, list[FloatArray]] = {name: [] for name in ("ln_p_m", *probes)}
    shared: dict[str, list[tuple[slice, FloatArray]]] = {}  # one value for several drops
    numerical = []
    at = 0
    for model in models:
        observed, name = model.observed, model.observed.name
        instrument = instruments[name]
        shift = log_offsets.get(name, 0.0)
        instant = model.instant

        def depth(
            lp: float, amps: Mapping[str, float], inst: Instrument, when: Instant, model: DropModel = model
        ) -> FloatArray:
            code = model.table.code(lp, when.log_speed, amps)
            offset = inst.row_offset_px * model.observed.pixel
            full = predict_depth(code, model.observed.time, when, inst.pixel_factor, inst.rate_factor, offset)
            return model.matrix @ full

        lp = log_p_m + shift
        code = model.table.code(lp, instant.log_speed, amplitudes)
        here = depth(lp, amplitudes, instrument, instant)
        data = model.matrix @ observed.depth
        speed = model.matrix @ predict_speed(
            code, observed.time, instant, instrument.pixel_factor, instrument.rate_factor
        )
        by_speed = (
            depth(lp, amplitudes, instrument, replace(instant, log_speed=instant.log_speed + 1e-3)) - here
        ) / 1e-3
        by_strength = (depth(lp + 1e-2, amplitudes, instrument, instant) - here) / 1e-2
        camera = observed.drop.camera
        assert camera is not None
        surface_sigma = max(camera.surface_row_sigma * observed.pixel, 1e-9)
        mass = observed.drop.projectile
        scatter = math.hypot(terms.scatter, MASS_TO_STRENGTH * mass.mass_sigma / mass.mass)
        widths = np.array([FREE, 0.05, surface_sigma, max(scatter, 1e-9)])
        columns = np.stack([-speed, by_speed, np.ones_like(here), by_strength], axis=1) * widths
        white = observed.sigma**2 * np.sum(model.matrix**2, axis=1)
        residual = data - here
        pull = np.array([0.0, 0.0, instant.surface / widths[2], 0.0])
        height = observed.drop.height
        extra = 0
        if terms.heights and height is not None and height.value > 0:
            # the stated height is one more datum: ln v
            expected = 0.5 * math.log(2 * STANDARD_GRAVITY * height.value)
            sigma = math.hypot(0.5 * height.sigma / height.value, SPEED_SLACK)
            # the logarithm of a height known to some ten percent is not normal; its mean is lower
            expected -= 0.25 * (height.sigma / height.value) ** 2
            residual = np.append(residual, expected - instant.log_speed)
            white = np.append(white, sigma**2)
            columns = np.vstack([columns, [0.0, widths[1], 0.0, 0.0]])
            extra = 1
        pad = np.zeros(extra)
        residual = residual - columns @ (-pull)  # nuisances are zero-mean about their priors, not about here
        points = residual.size
        sections[name] = slice(at, at + points)
        at += points
        residuals.append(residual)
        noises.append(white)
        local.append(columns)
        pulls.append(pull)
        tangents["ln_p_m"].append(np.concatenate([by_strength, pad]))
        for probe, (amps, insts, offsets, step) in probes.items():
            moved = depth(log_p_m + offsets.get(name, 0.0), amps, insts[name], instant)
            tangents[probe].append(np.concatenate([(moved - here) / step, pad]))
        scale = depth(
            lp, amplitudes, instrument.replace(pixel_factor=instrument.pixel_factor * 1.001), instant
        )
        rate = depth(lp, amplitudes, instrument.replace(rate_factor=instrument.rate_factor * 1.001), instant)
        key = f"{observed.pixel:.6g} {camera.frame_rate:.6g}"
        for kind, moved, width in (("pixel", scale, terms.pixel_scale), ("frame", rate, terms.frame_scale)):
            column = np.concatenate([(moved - here) / 1e-3 * width, pad])
            shared.setdefault(f"{kind} {key}", []).append((sections[name], column))
        offset_column = np.concatenate([np.full(here.size, terms.contact_offset * model.radius), pad])
        shared.setdefault("contact offset", []).append((sections[name], offset_column))
        # two codes part slowly from slow to fast drops: the one is too deep at one end, too shallow at the other
        swift = instant.log_speed - 0.5 * math.log(STANDARD_GRAVITY * model.radius) - USUAL_SWIFTNESS
        slope = np.maximum(here, 0.0) * swift * terms.numerical_slope
        for kind, column in (("slope", slope), ("strength", by_strength * terms.numerical_strength)):
            column = np.concatenate([column, pad])
            shared.setdefault(f"numerical {kind}", []).append((sections[name], column))
        final = float(np.exp(code[0]))
        stop = float(np.exp(code[1]))
        clock = model.matrix @ (observed.time / instrument.rate_factor - instant.contact_time)
        fraction = np.clip(clock / stop, 0.0, 1.0)
        reached = np.clip(here * instrument.pixel_factor, 0.0, final) * (clock > 0)
        changed = here - depth(lp, {}, instrument, instant) if amplitudes else np.zeros_like(here)
        numerical.append(
            (
                np.concatenate([np.hypot(reached * terms.numerical, changed * terms.numerical_change), pad]),
                np.concatenate([fraction, pad]),
                instant.log_speed - 0.5 * math.log(model.radius),
                math.log(model.radius),
                math.log(mass.mass / model.radius**3),
            )
        )
    n = at
    covariance = np.diag(np.concatenate(noises))
    for model, columns in zip(models, local, strict=True):
        block = sections[model.observed.name]
        covariance[block, block] += columns @ columns.T
    for parts in shared.values():
        whole = np.zeros(n)
        for section, column in parts:
            whole[section] = column
        covariance += np.outer(whole, whole)
    covariance += _numerical_covariance(numerical)
    return Linearised(
        np.concatenate(residuals),
        covariance,
        {name: np.concatenate(parts) for name, parts in tangents.items()},
        sections,
        local,
        pulls,
    )


def _numerical_covariance(parts: Sequence[tuple[FloatArray, FloatArray, float, float, float]]) -> FloatArray:
    """The solver's error of the depth: as large as terms.numerical of the depth reached, alike for alike drops."""
    size = np.concatenate([part[0] for part in parts])
    fraction = np.concatenate([part[1] for part in parts])
    froude, radius, mass = (
        np.concatenate([np.full(part[0].size, part[k]) for part in parts]) for k in (2, 3, 4)
    )
    distance = (
        (np.subtract.outer(fraction, fraction) / 0.4) ** 2
        + (np.subtract.outer(froude, froude) / 0.8) ** 2
        + (np.subtract.outer(radius, radius) / 2.0) ** 2
        + (np.subtract.outer(mass, mass) / 1.5) ** 2
    )
    return np.outer(size, size) * np.exp(-0.5 * distance)


def solve_globals(
    blocks: Sequence[Block], names: Sequence[str], priors: Mapping[str, tuple[float, float]]
) -> tuple[FloatArray, FloatArray, float, float, list[FloatArray]]:
    """Step of the globals (k,), their covariance, χ² left, ln det C, and C⁻¹ (residual - tangents step) per block.

    priors: name -> (distance of the current value from the prior's middle, prior width); flat where absent.
    """
    information, gradient = np.zeros((len(names), len(names))), np.zeros(len(names))
    factors, designs, log_determinant = [], [], 0.0
    for block in blocks:
        factor = _factorise(block.covariance)
        design = np.stack([block.tangents[name] for name in names], axis=1)
        solved = cho_solve(factor, design)
        information += design.T @ solved
        gradient += solved.T @ block.residual
        log_determinant += 2 * float(np.sum(np.log(np.diag(factor[0]))))
        factors.append(factor)
        designs.append(design)
    for k, name in enumerate(names):
        if name in priors:
            away, width = priors[name]
            information[k, k] += 1 / width**2
            gradient[k] -= away / width**2
    covariance = np.linalg.inv(information)
    step = covariance @ gradient
    chi_square, weighted = 0.0, []
    for block, factor, design in zip(blocks, factors, designs, strict=True):
        left = block.residual - design @ step
        weighted.append(cho_solve(factor, left))
        chi_square += float(left @ weighted[-1])
    return step, covariance, chi_square, log_determinant, weighted


def _factorise(covariance: FloatArray) -> tuple[FloatArray, bool]:
    """Cholesky factor; rounding is mended. Raises ExtrapolationError where the model has no answer."""
    try:
        if np.all(np.isfinite(covariance)):
            with suppress(np.linalg.LinAlgError):
                return cho_factor(covariance, lower=True)
            return cho_factor(covariance + 1e-9 * np.diag(np.diag(covariance)), lower=True)
    except np.linalg.LinAlgError:
        pass
    raise ExtrapolationError("simulation", "runs", "extrapolate to no finite depth here; see labsim runs")


def chi_square(block: Block) -> float:
    """Squared length of a block's whitened residual."""
    white = solve_triangular(_factorise(block.covariance)[0], block.residual, lower=True)
    return float(white @ white)


def update_nuisances(models: Sequence[DropModel], linear: Linearised, weighted: FloatArray) -> float:
    """Move each drop's nuisances to their conditional best values; return the largest move in prior widths
    (contact time in units of a frame)."""
    largest = 0.0
    for model, columns in zip(models, linear.local, strict=True):
        section = linear.sections[model.observed.name]
        best = columns.T @ weighted[section]  # in prior widths, about the priors' middles
        instant = model.instant
        camera = model.observed.drop.camera
        assert camera is not None
        surface_sigma = max(camera.surface_row_sigma * model.observed.pixel, 1e-9)
        moved = Instant(
            instant.contact_time + best[0] * FREE,
            instant.log_speed + best[1] * 0.05,
            best[2] * surface_sigma,
        )
        largest = max(
            largest,
            abs(best[0] * FREE) * camera.frame_rate,
            abs(best[1] * 0.05) * 100,
            abs(moved.surface - instant.surface) / surface_sigma,
        )
        model.instant = moved
    return largest
