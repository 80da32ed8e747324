"""What is shown of every drop: measured, simulated, what is left, and how much a true model may leave."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...diagnosis.campaign import Diagnosis
from ...inference.calibrate import Calibration
from ...inference.emulation.forward import Instant, predict_depth
from ...inference.fits.fitting import Fit
from ...inference.fits.posterior import Posterior
from ...inference.observations.acceleration_model import AccelerationModel
from ...inference.observations.drop_model import DropModel
from ...inference.observations.push_model import PushModel
from ...inference.problem import Problem
from ...records import STANDARD_GRAVITY, FloatArray, Projectile

BEFORE = 0.3  # share of the record after contact that is shown before it
STOP_FRAMES = 3  # the last frames whose mean stands for the depth at the stop


@dataclass(frozen=True)
class Shown:
    """Words and factors of what is drawn against time: the quantity, and what is left of it; datum : one of them; above : what
    it means where more is measured than simulated; free : what is at its best value."""

    label: str
    factor: float
    left_label: str
    left_factor: float
    unit: str
    left_unit: str
    downwards: bool
    datum: str
    above: str
    free: str


DEPTH = Shown(
    "depth (mm)", 1e3, "residual (µm)", 1e6, "mm", "µm", True,
    "frame", "the projectile went deeper than the simulation says", "contact time, impact speed and surface row",
)  # fmt: skip
FELT = Shown(
    "acceleration (g)", 1 / STANDARD_GRAVITY, "residual (g)", 1 / STANDARD_GRAVITY, "g", "g", False,
    "value", "an accelerometer felt more than the simulation says", "contact time and impact speed",
)  # fmt: skip


@dataclass(frozen=True)
class DropView:
    """One drop; arrays of shape (n,), one entry a frame that is shown (or a stretch of an accelerometer's record, for which m
    reads m/s², felt upwards).

    ends : of an accelerometer, depth (m) at the stop of each fit, and measured under "", as it integrates; allowed_end : m;
    lengths : (n, n) that turns what is left into m.

    clock : s since contact of the first fit; measured : m below the undisturbed surface; simulated : name of the fit ->
    depth (m) at the same frames; allowed : m, standard deviation of what a true model leaves of a frame, noise included;
    noise : m, of the localisation alone.
    """

    name: str
    projectile: Projectile
    speed: float  # m/s at contact, of the first fit
    clock: FloatArray
    measured: FloatArray
    simulated: dict[str, FloatArray]
    allowed: FloatArray
    noise: float
    ends: dict[str, float] | None = None
    allowed_end: float = 0.0
    lengths: FloatArray | None = None

    @property
    def shown(self) -> Shown:
        """How the quantity is drawn."""
        return DEPTH if self.ends is None else FELT

    def left(self, fit: str) -> FloatArray:
        """Measured minus simulated, m."""
        return self.measured - self.simulated[fit]

    def rms(self, fit: str) -> float:
        """Of what is left below the surface, m; of an accelerometer as it integrates."""
        if self.lengths is not None:
            return float(np.sqrt(np.mean((self.lengths @ self.left(fit))[self.clock >= 0] ** 2)))
        below = self.clock >= 0
        left = self.left(fit)[below] if below.any() else self.left(fit)
        return float(np.sqrt(np.mean(left**2)))

    def at_stop(self, fit: str | None = None) -> float:
        """Depth (m) where the record ends: measured, or of a fit."""
        if self.ends is not None:
            return self.ends[fit or ""]
        values = self.measured if fit is None else self.simulated[fit]
        return float(np.mean(values[-STOP_FRAMES:]))

    @property
    def allowed_at_stop(self) -> float:
        return float(np.mean(self.allowed[-STOP_FRAMES:])) if self.ends is None else self.allowed_end

    def stands_out(self, fit: str) -> bool:
        """Whether more frames lie outside two standard deviations than a true model would leave (one in ten)."""
        return bool(np.mean(np.abs(self.left(fit)) > 2 * self.allowed) > 0.1)


def list_fits(found: Calibration | Diagnosis) -> list[tuple[str, Fit]]:
    """The models that are shown of a result, by name: of a diagnosis nominal and, where one is found, with the cause."""
    if isinstance(found, Calibration):
        return [(" + ".join(found.fit.hypothesis) or "nominal", found.fit)]
    extended = [] if found.best is found.nominal else [(" + ".join(found.best.hypothesis), found.best)]
    return [("nominal", found.nominal), *extended]


def list_posteriors(found: Diagnosis) -> list[tuple[str, Posterior]]:
    """The posteriors of ``list_fits``, by the same names."""
    names = [name for name, _ in list_fits(found)]
    return list(zip(names, (found.posterior_nominal, found.posterior_extended), strict=False))


def view_drops(problem: Problem, fits: Sequence[tuple[str, Fit]]) -> list[DropView]:
    """Every drop that entered the likelihood, in the order of the campaign, with each named fit."""
    views = []
    first = fits[0][1]
    offsets = {name: contact_offset(problem, fit) for name, fit in fits}
    tracks = problem.tracks
    seen_by = {name: tracks.instants(fit.nuisances[0]) for name, fit in fits}
    for k, (model, instant) in enumerate(
        zip(tracks.models, tracks.instants(first.nuisances[0]), strict=True)
    ):
        if isinstance(model, AccelerationModel):
            views.append(
                _view_acceleration(problem, fits, model, instant, [seen_by[name][k] for name, _ in fits])
            )
            continue
        if isinstance(model, PushModel):
            continue  # of pushes there is a page of its own
        observed = model.observed
        clock = observed.time - instant.contact_time
        seen = clock > -BEFORE * max(clock.max(), 1e-9)
        simulated = {}
        for name, fit in fits:
            simulated[name] = predict_drop(problem, fit, model, seen_by[name][k], offsets[name])[seen]
        views.append(
            DropView(
                observed.name,
                observed.drop.projectile,
                math.exp(instant.log_speed),
                clock[seen],
                observed.depth[seen],
                simulated,
                allow_for_errors(problem, first, model)[seen],
                observed.sigma,
            )
        )
    return views


def _view_acceleration(
    problem: Problem,
    fits: Sequence[tuple[str, Fit]],
    model: AccelerationModel,
    instant: Instant,
    instants: Sequence[Instant],
) -> DropView:
    """One accelerometer's record; the zero and the scale of its sensors are within what is allowed."""
    observed, first = model.observed, fits[0][1]
    clock = observed.time - instant.contact_time
    seen = clock > -BEFORE * clock.max()
    simulated, ends = {}, {"": model.deepest}
    for (name, fit), own in zip(fits, instants, strict=True):
        log_p_m = fit.log_p_m + problem.log_offsets(fit.values)[observed.name]
        features = model.table.features(log_p_m, own.log_speed, fit.values)
        simulated[name] = model.predict(features, problem.instruments(fit.values)[observed.name], own)
        ends[name] = math.exp(float(features[0]))
    last = model.lengths[-1]
    # measured depth at the stop: that of the first fit and what the record integrates to beyond it
    ends[""] = ends[fits[0][0]] + float(last @ (model.data - simulated[fits[0][0]]))
    place = list(first.drops.sections).index(observed.name)
    start, points = first.drops.sections[observed.name].start, model.data.size
    own_errors = first.drops.covariance[start : start + points, start : start + points].copy()
    free = first.drops.local[place][:points, :2]
    own_errors -= free @ free.T
    return DropView(
        observed.name,
        observed.drop.projectile,
        math.exp(instant.log_speed),
        clock[seen],
        model.data[seen],
        {name: values[seen] for name, values in simulated.items()},
        np.sqrt(np.maximum(np.diag(own_errors), 0.0))[seen],
        float(np.median(observed.noise[seen])),
        ends,
        math.sqrt(max(float(last @ own_errors @ last), 0.0)),
        model.lengths[np.ix_(seen, seen)],
    )


def predict_drop(
    problem: Problem, fit: Fit, model: DropModel, instant: Instant, contact: float
) -> FloatArray:
    """Stated depth (m) at the drop's frames; instant : its nuisances; contact : the fit's contact_offset."""
    name = model.observed.name
    instrument = problem.instruments(fit.values)[name]
    log_p_m = fit.log_p_m + problem.log_offsets(fit.values)[name]
    features = model.table.features(log_p_m, instant.log_speed, fit.values)
    offset = instrument.row_offset_px * model.observed.pixel
    offset += contact * model.radius
    time = model.observed.time
    return predict_depth(features, time, instant, instrument, offset)


def contact_offset(problem: Problem, fit: Fit) -> float:
    """Best value, in tip radii, of the offset of the contact that the likelihood allows all drops in common."""
    drops, size = fit.drops, problem.budget.contact_offset
    column = np.zeros(drops.residual.size)
    for model in problem.tracks.models:
        if not isinstance(model, DropModel):
            continue
        section = drops.sections[model.observed.name]
        column[section.start : section.start + model.matrix.shape[0]] = size * model.radius
    return size * float(column @ drops.solve(drops.residual))


def allow_for_errors(problem: Problem, fit: Fit, model: DropModel) -> FloatArray:
    """(frames,) m: standard deviation of measured minus predict_drop if the model were true.

    The likelihood's own variances without what predict_drop has already moved to its best value (contact time, speed,
    surface row, contact offset): localisation, sample scatter, stated mass and scales, error of the solver.
    """
    drops, observed = fit.drops, model.observed
    place = list(drops.sections).index(observed.name)
    points = model.matrix.shape[0]
    start = drops.sections[observed.name].start
    variance = np.diag(drops.covariance)[start : start + points].copy()
    variance -= np.sum(drops.local[place][:points, :3] ** 2, axis=1)
    variance -= (problem.budget.contact_offset * model.radius) ** 2
    variance -= observed.sigma**2 * np.sum(model.matrix**2, axis=1)
    systematic = np.interp(observed.time, model.matrix @ observed.time, np.maximum(variance, 0.0))
    return np.sqrt(systematic + observed.sigma**2)
