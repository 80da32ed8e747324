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
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from ..inference.emulation.curves import extract_curve
from ..inference.emulation.forward import Instant, ResponseTable
from ..inference.emulation.grid import ProjectileGroup, sparse_positions, speed_nodes
from ..inference.fits.fitting import Fit, require_runs
from ..inference.fits.tangents import linearise_at
from ..inference.observations import RunFeatures
from ..inference.observations.drop_model import DropModel
from ..inference.observations.observe import FilmedDrop, ObservedDrop
from ..inference.problem import Problem
from ..records import STANDARD_GRAVITY, Camera, FloatArray, Projectile
from .gain import weigh_globals

USUAL_SIGMA, USUAL_PIXEL = 2e-6, 1e-5  # m, of a camera where no drop had one
USUAL_FRAMES = 40.0  # of it, up to the stop
FALL, DUST = 6, 24  # rows that stand for all frames before contact, one stopping time long, and after it
END = 1.05  # of the stopping time: films are compared up to the stop
HEAVIER, LARGER = 3.0, 2.0  # than the usual projectile, in mass and in radius
ALIKE = 1.3  # factor in radius, or in mass over its cube, within which a projectile is there already


@dataclass(frozen=True)
class Prediction:
    """Of one planned drop by one hypothesis. mean : (n,) m, spread : (n, n) of its rows in the dust, where the free fall above is
    seen as planned; depth, depth_sigma : m; stop : s."""

    mean: FloatArray
    spread: FloatArray
    depth: float
    depth_sigma: float
    stop: float

    @property
    def text(self) -> str:
        """Depth and stopping time in the units of the laboratory."""
        return f"{self.depth * 1e3:.3f} ± {self.depth_sigma * 1e3:.3f} mm in {self.stop * 1e3:.2f} ms"


def plan_drops(
    problem: Problem, fit: Fit, *, other_projectiles: bool
) -> tuple[Problem, list[tuple[str, DropModel]]]:
    """The problem with drops beside those that were made, and what each of them would be, in words.

    fit : whose depth and stop say when the camera looks. other_projectiles : a heavier and a larger one too, which need runs.
    Nothing of ``problem`` is changed.
    """
    tracks = copy.deepcopy(problem.tracks)
    groups, features = list(problem.groups), list(tracks.features)
    planned: list[tuple[str, int, float]] = []
    for number, group in enumerate(problem.groups):
        if not (group.is_scan or group.pushed):
            planned += [("one more drop with", number, speed) for speed in group.speeds[1:]]
    for projectile, speed in _list_others(problem) if other_projectiles else []:
        nodes = speed_nodes(speed, speed)
        sparse = sparse_positions(nodes, False)
        features.append(RunFeatures(len(groups), ResponseTable(np.log(nodes), sparse), extract_curve))
        planned.append(("a drop with another projectile,", len(groups), speed))
        groups.append(ProjectileGroup(projectile, nodes, False, sparse))
    extended = replace(
        problem,
        grid=replace(problem.grid, groups=groups, runs=dict(problem.grid.runs)),
        groups=groups,
        observations=(replace(tracks, features=tuple(features)),),
        _filled=set(problem._filled),
        _plain=dict(problem._plain),
    )
    require_runs(extended, fit)
    last = max(problem.campaign.drops, key=lambda drop: drop.sequence)
    drops, places = list(problem.campaign.drops), dict(problem.places)
    models: list[tuple[str, DropModel]] = []
    for words, number, speed in planned:
        projectile = groups[number].projectile
        table = next(each.table for each in features if each.group == number)
        name = f"planned {len(models) + 1}"
        stop = math.exp(table.features(fit.log_p_m, math.log(speed), fit.values)[1])
        seen = _plan_film(problem, name, projectile, stop)
        text = (
            f"{words} the {2e3 * projectile.tip_radius:.3g} mm tip of {projectile.mass * 1e6:.3g} mg at {speed:.2f} m/s "
            f"(height {speed**2 / 2 / STANDARD_GRAVITY * 1e3:.1f} mm)"
        )
        start = Instant(0.0, math.log(speed), 0.0)
        models.append((text, DropModel(seen, table, start, np.eye(seen.time.size))))
        drops.append(seen.drop)
        places[name] = replace(places[last.name], name=name, tip=projectile.tip)
    return replace(
        extended,
        campaign=replace(problem.campaign, drops=tuple(drops)),
        places=places,
        observations=(
            replace(extended.tracks, models=(*extended.tracks.models, *(model for _, model in models))),
        ),
    ), models


def predict_planned(problem: Problem, extended: Problem, fit: Fit) -> list[Prediction]:
    """What a fit predicts of every planned drop of ``extended``, given the data that it was fitted to."""
    require_runs(extended, fit)
    made, models = len(problem.tracks.models), extended.tracks.models
    starts = np.array([model.start for model in models[made:]])
    (linear,) = linearise_at(extended, (np.vstack([fit.nuisances[0], starts]),), fit.log_p_m, fit.values)
    names = ["ln_p_m", *fit.hypothesis]
    design = np.stack([linear.tangents[name] for name in names], axis=1)
    seen = np.arange(linear.residual.size) < linear.sections[models[made].observed.name].start
    pull, precision = weigh_globals(problem, fit, names)
    factor = cho_factor(linear.covariance[np.ix_(seen, seen)], lower=True)
    solved = cho_solve(factor, design[seen])
    covariance = np.linalg.inv(design[seen].T @ solved + precision)
    best = covariance @ (solved.T @ linear.residual[seen] + pull)
    left = cho_solve(factor, linear.residual[seen] - design[seen] @ best)
    offsets, instruments = extended.log_offsets(fit.values), extended.instruments(fit.values)
    found = []
    for model in models[made:]:
        assert isinstance(model, DropModel)
        name = model.observed.name
        own = linear.sections[name]
        cross = linear.covariance[own][:, seen]
        reach = design[own] - cross @ solved
        # the data are nought: what is left of them is the simulation's rows, downwards
        mean = design[own] @ best + cross @ left - linear.residual[own]
        spread = linear.covariance[own, own] - cross @ cho_solve(factor, cross.T)
        spread = spread + reach @ covariance @ reach.T
        features = model.table.features(fit.log_p_m + offsets[name], model.start.log_speed, fit.values)
        time, speed = model.observed.time, math.exp(model.start.log_speed)
        falls = time < 0.0
        fall = time[falls] * (speed + 0.5 * STANDARD_GRAVITY * time[falls])
        mean, spread = _condition(mean, spread, falls, fall)
        deepest = int(np.argmax(mean))
        found.append(
            Prediction(
                mean,
                spread,
                float(mean[deepest]),
                math.sqrt(spread[deepest, deepest]),
                math.exp(features[1]) * instruments[name].rate_factor,
            )
        )
    return found


def _condition(
    mean: FloatArray, spread: FloatArray, known: np.ndarray, values: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Mean and covariance of the other entries of a normal distribution, where the ``known`` (n,) ones have these values."""
    across = np.linalg.solve(spread[np.ix_(known, known)], spread[known][:, ~known]).T
    return (
        mean[~known] + across @ (values - mean[known]),
        spread[np.ix_(~known, ~known)] - across @ spread[known][:, ~known],
    )


def _list_others(problem: Problem) -> list[tuple[Projectile, float]]:
    """A projectile HEAVIER, and one LARGER of the same density, than that of most drops, where there is none like it; and the
    speed (m/s) at which it goes about as deep in its radii as that one at its middle speed."""
    groups = [group for group in problem.groups if not (group.is_scan or group.pushed)]
    if not groups:
        return []
    drops = [drop.projectile.simulated for drop in problem.campaign.drops]
    usual = max(groups, key=lambda group: drops.count(group.projectile))
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
    return FilmedDrop(drop, time, np.zeros(time.size), sigma / math.sqrt(share))
