"""Drops that nobody has made yet: what each hypothesis predicts of their films, given all that was measured so far.

A planned drop is one more record in the likelihood, without data. About the best of a hypothesis its rows and those of all drops
have one joint normal distribution, errors that they share included; given today's data its own rows are normal too, with a mean
that corrects the simulation as the drops so far ask for. So an error that is common to all drops, as what another code would say
of p_m, costs a planned drop nothing. Contact and speed are known from a free fall that is seen as planned: left free, their prior
is so wide that the least difference of two simulated speeds would pass for evidence.
"""

from __future__ import annotations

import copy
import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..inference.emulation.curves import extract_curve
from ..inference.emulation.forward import Instant, ResponseTable
from ..inference.emulation.grid import ProjectileGroup, sparse_positions, speed_nodes
from ..inference.fits.blocks import Block
from ..inference.fits.fitting import Fit, require_runs
from ..inference.fits.tangents import linearise_at
from ..inference.observations import RunFeatures
from ..inference.observations.drop_model import DropModel
from ..inference.observations.observe import FilmedDrop, ObservedDrop
from ..inference.problem import Problem
from ..records import STANDARD_GRAVITY, Camera, FloatArray, Projectile
from .gain import predict_unseen, stack_tangents, weigh_globals

USUAL_SIGMA, USUAL_PIXEL = 2e-6, 1e-5  # m, of a camera where no drop had one
USUAL_FRAMES = 40.0  # of it, up to the stop
FALL, DUST = 6, 24  # rows that stand for all frames before contact, one stopping time long, and after it
END = 1.05  # of the stopping time: films are compared up to the stop
HEAVIER, LARGER = 3.0, 2.0  # than the usual projectile, in mass and in radius
ALIKE = 1.3  # factor in radius, or in mass over its cube, within which a projectile is there already


@dataclass(frozen=True)
class Prediction(ABC):
    """Of one planned measurement by one hypothesis: mean (n,) and covariance (n, n) of its data."""

    mean: FloatArray
    spread: FloatArray

    @property
    @abstractmethod
    def text(self) -> str:
        """What a person would look for, in the units of the laboratory."""

    @abstractmethod
    def summarise(self) -> dict[str, float]:
        """The same as numbers, units in their names."""


@dataclass(frozen=True)
class DropPrediction(Prediction):
    """Of one drop: m, of its rows in the dust, where the free fall above is seen as planned; depth, depth_sigma : m; stop : s."""

    depth: float
    depth_sigma: float
    stop: float

    @property
    def text(self) -> str:
        return f"{self.depth * 1e3:.3f} ± {self.depth_sigma * 1e3:.3f} mm in {self.stop * 1e3:.2f} ms"

    def summarise(self) -> dict[str, float]:
        return {
            "depth_mm": self.depth * 1e3,
            "depth_sd_mm": self.depth_sigma * 1e3,
            "stopping_time_ms": self.stop * 1e3,
        }


def plan_drops(
    problem: Problem, standing: Sequence[Fit], *, new: bool
) -> tuple[Problem, list[tuple[str, str]]]:
    """The problem with drops beside those that were made, and what each of them would be, in words, and how fast.

    standing : hypotheses, the most probable first, whose depth and stop say when the camera looks. new : a heavier and a larger
    projectile too, which need runs. Nothing of ``problem`` is changed.
    """
    tracks, first = copy.deepcopy(problem.tracks), standing[0]
    groups, features = list(problem.groups), list(tracks.features)
    tables = {each.group: each.table for each in reversed(features)}  # of the curve, the first of a group
    usual, causes = find_usual(problem), sorted({name for fit in standing for name in fit.hypothesis})
    planned: list[tuple[str, int, float, ResponseTable]] = []
    for number, group in enumerate(problem.groups):
        if group.is_scan or group.pushed:
            continue
        planned += [("one more drop with", number, speed, tables[number]) for speed in group.speeds[1:]]
        for name in causes:
            if group is usual and (way := problem.effects[name].without):
                table = replace(tables[number], absent=frozenset({name}))
                planned += [(f"a drop {way}, with", number, speed, table) for speed in group.speeds[1:]]
    for projectile, speed in _list_others(problem) if new else []:
        nodes = speed_nodes(speed, speed)
        sparse = sparse_positions(nodes, False)
        table = ResponseTable(np.log(nodes), sparse)
        features.append(RunFeatures(len(groups), table, extract_curve))
        planned.append(("a drop with another projectile,", len(groups), speed, table))
        groups.append(ProjectileGroup(projectile, nodes, False, sparse))
    tracks = replace(tracks, features=tuple(features))
    extended = problem.observe_by([tracks], groups, problem.campaign, problem.places)
    require_runs(extended, first)
    last = max(problem.campaign.drops, key=lambda drop: drop.sequence)
    drops, places = list(problem.campaign.drops), dict(problem.places)
    models: list[DropModel] = []
    said = []
    for words, number, speed, table in planned:
        projectile = groups[number].projectile
        name = f"planned {len(models) + 1}"
        stop = math.exp(table.features(first.log_p_m, math.log(speed), first.values)[1])
        seen = _plan_film(problem, name, projectile, stop)
        said.append(
            (
                f"{words} {name_tip(projectile)}",
                f"at {speed:.2f} m/s (height {speed**2 / 2 / STANDARD_GRAVITY * 1e3:.1f} mm)",
            )
        )
        start = Instant(0.0, math.log(speed), 0.0)
        models.append(DropModel(seen, table, start, np.eye(seen.time.size)))
        drops.append(seen.drop)
        places[name] = replace(places[last.name], name=name, tip=projectile.tip)
    seen_by = replace(tracks, models=(*tracks.models, *models))
    campaign = replace(problem.campaign, drops=tuple(drops))
    return replace(extended, campaign=campaign, places=places, observations=(seen_by,)), said


def predict_drops(problem: Problem, extended: Problem, standing: Sequence[Fit]) -> list[list[Prediction]]:
    """What each fit predicts of every planned drop of ``extended``, given the data that it was fitted to."""
    made, models = len(problem.tracks.models), extended.tracks.models
    starts = np.array([model.start for model in models[made:]])
    linear = []
    for fit in standing:
        require_runs(extended, fit)
        nuisances = np.vstack([fit.nuisances[0], starts])
        linear.append(linearise_at(extended, (nuisances,), fit.log_p_m, fit.values)[0])
    sections = linear[0].sections
    first = sections[models[made].observed.name].start
    seen = np.arange(linear[0].residual.size) < first
    found: list[list[Prediction]] = []
    for fit, block in zip(standing, linear, strict=True):
        mean, spread = predict_rows(problem, fit, {0: block}, seen, linear[0].covariance)
        offsets, instruments = extended.log_offsets(fit.values), extended.instruments(fit.values)
        found.append([])
        for model in models[made:]:
            assert isinstance(model, DropModel)
            name = model.observed.name
            rows = slice(sections[name].start - first, sections[name].stop - first)
            features = model.table.features(fit.log_p_m + offsets[name], model.start.log_speed, fit.values)
            time, speed = model.observed.time, math.exp(model.start.log_speed)
            falls = time < 0.0
            fall = time[falls] * (speed + 0.5 * STANDARD_GRAVITY * time[falls])
            depth, error = _condition(mean[rows], spread[rows, rows], falls, fall)
            deepest = int(np.argmax(depth))
            found[-1].append(
                DropPrediction(
                    depth,
                    error,
                    float(depth[deepest]),
                    math.sqrt(error[deepest, deepest]),
                    math.exp(features[1]) * instruments[name].rate_factor,
                )
            )
    return found


def predict_rows(
    problem: Problem, fit: Fit, blocks: Mapping[int, Block], seen: np.ndarray, covariance: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Mean (n,) and covariance (n, n) of rows that nobody has measured yet, whose data are nought, given all data of a fit.

    blocks : by their place among the problem's observations, with those rows beside the measured ones; a place of its own where
    there was nothing of that kind. seen : (rows,) bool, of all blocks together, which were measured. covariance : (rows, rows) of
    their errors, the same for all fits: that two causes have errors of another shape is no evidence.
    """
    names = ["ln_p_m", *fit.hypothesis]
    design = np.concatenate([stack_tangents(each, names) for each in blocks.values()])
    residual = np.concatenate([each.residual for each in blocks.values()])
    pull, precision = weigh_globals(problem, fit, names, blocks)
    unseen = predict_unseen(~seen, design, covariance, precision)
    return -unseen.miss(residual, pull), unseen.spread  # data of nought less what is expected of them


def _condition(
    mean: FloatArray, spread: FloatArray, known: np.ndarray, values: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Mean and covariance of the other entries of a normal distribution, where the ``known`` (n,) ones have these values."""
    across = np.linalg.solve(spread[np.ix_(known, known)], spread[known][:, ~known]).T
    return (
        mean[~known] + across @ (values - mean[known]),
        spread[np.ix_(~known, ~known)] - across @ spread[known][:, ~known],
    )


def name_tip(projectile: Projectile) -> str:
    """The projectile in words."""
    return f"the {2e3 * projectile.tip_radius:.3g} mm tip of {projectile.mass * 1e6:.3g} mg"


def find_usual(problem: Problem) -> ProjectileGroup | None:
    """The group of most drops; None where none was made."""
    groups = [group for group in problem.groups if not (group.is_scan or group.pushed)]
    drops = [drop.projectile.simulated for drop in problem.campaign.drops]
    return max(groups, key=lambda group: drops.count(group.projectile), default=None)


def _list_others(problem: Problem) -> list[tuple[Projectile, float]]:
    """A projectile HEAVIER, and one LARGER of the same density, than that of most drops, where there is none like it; and the
    speed (m/s) at which it goes about as deep in its radii as that one at its middle speed."""
    groups = [group for group in problem.groups if not (group.is_scan or group.pushed)]
    usual = find_usual(problem)
    if usual is None:
        return []
    middle = usual.speeds[len(usual.speeds) // 2]
    one = usual.projectile
    heavier = replace(one, mass=HEAVIER * one.mass)
    larger = replace(one, tip_radius=LARGER * one.tip_radius, mass=LARGER**3 * one.mass)
    wanted = [(heavier, middle / math.sqrt(HEAVIER)), (larger, middle)]

    def differ(first: Projectile, second: Projectile) -> bool:
        radius = first.tip_radius / second.tip_radius
        mass = first.mass / second.mass / radius**3
        return max(abs(math.log(radius)), abs(math.log(mass))) > math.log(ALIKE)

    return [
        (each, speed) for each, speed in wanted if all(differ(each, group.projectile) for group in groups)
    ]


def _plan_film(problem: Problem, name: str, projectile: Projectile, stop: float) -> FilmedDrop:
    """A film of a drop that stops after ``stop`` (s), by the campaign's usual camera."""
    films = [drop for drop in problem.drops if isinstance(drop, ObservedDrop)]
    like = films[0].drop if films else problem.campaign.drops[0]
    camera = like.camera or Camera(USUAL_FRAMES / stop, USUAL_PIXEL, 0.0, 0.0)
    sigma = float(np.median([drop.sigma for drop in films])) if films else USUAL_SIGMA
    drop = replace(
        like,
        name=name,
        projectile=projectile,
        height=None,
        impact_speed=None,
        camera=camera,
        accelerometer=None,
        same_as="",
    )
    time = stop * np.concatenate([np.linspace(-1.0, -0.05, FALL), np.linspace(0.03, END, DUST)])
    share = max(camera.frame_rate * stop * END / DUST, 1.0)  # frames that one row stands for
    sigma /= math.sqrt(share)
    return FilmedDrop(drop, time, np.zeros(time.size), sigma, sigma)
