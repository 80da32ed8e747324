"""Campaigns whose truth is known: labsim's own solver at another spacing, other nodes, with every nuisance a laboratory has.

Tracks come from the runs of a TruthTable; each drop gets a camera that starts at its own instant, a height that is not quite the
stated one, a sample of its own strength, a surface row that is off within its uncertainty, noise, missing frames and outliers:
Laboratory holds their sizes, QUIET none. Scans are given as what their undisturbed dust shows, and, where the table has a
reduced scan for a template, as a map.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.truths.table import DRIFT, Hidden, TruthTable
from labsim.ct.reduce import ReducedScan
from labsim.effects import Instrument, list_places
from labsim.inference.emulation.forward import Instant, predict_depth
from labsim.inference.measure import Measurements
from labsim.inference.observations.observe import Observed, judge_noise, observe_drop
from labsim.inference.observations.undisturbed import UndisturbedDust
from labsim.records import STANDARD_GRAVITY, Drop, Track
from labsim.sph.particles import initial_filling_factor

AFTER_STOP = 1.1  # frames kept, in stopping times
CONTACT = 3.5e-3  # s after the first frame
ROW_NOISE = 1.5e-4  # of the filling factor of a row of undisturbed dust
ROW_STEP, ROW_DEPTH = 8e-5, 3.3e-3  # m


@dataclass(frozen=True)
class Laboratory:
    """Sizes of everything that stands between a truth and its records.

    rows, heights, surfaces, scan_speeds, maps : in stated uncertainties. outliers, missing : shares of frames. samples : of ln
    p_m from sample to sample. guide : of the impact speed. contacts : s, range of the instant of contact. dust : filling factor
    of a row of undisturbed dust. point_spread : of its logarithm. lift : m, of a bead at rest over where its run ends, the
    scale of an exponential law.
    """

    rows: float = 1.0
    outliers: float = 0.01
    missing: float = 0.01
    samples: float = 0.02
    heights: float = 1.0
    guide: float = 0.002
    contacts: float = 1e-3
    surfaces: float = 1.0
    dust: float = ROW_NOISE
    point_spread: float = 0.1
    scan_speeds: float = 1.0
    maps: float = 1.0
    lift: float = 40e-6


LABORATORY = Laboratory()
QUIET = Laboratory(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def measure_hidden(
    truth: TruthTable,
    hidden: Hidden,
    rng: np.random.Generator,
    scans: int = 2,
    laboratory: Laboratory = LABORATORY,
) -> Measurements:
    """What the cameras and the scanner of a laboratory would have recorded of a truth, with maps where the truth has templates.

    Raises SimulationError where its runs are missing.
    """
    campaign = truth.campaign
    places = list_places(campaign)
    drops: list[Observed] = []
    for drop in campaign.drops:
        place, shift = places[drop.name], laboratory.samples * rng.standard_normal()
        if DRIFT in hidden.effects:
            plain = truth.setting(drop.projectile.simulated, 0.5, hidden.p_m)
            changed = truth.apply({DRIFT: hidden.effects[DRIFT]}, plain, place)
            shift += math.log(changed.material.p_m / hidden.p_m)
        instrument = truth.instrument(hidden, place)
        track = _film(truth, hidden, drop, instrument, math.log(hidden.p_m) + shift, rng, laboratory)
        drops.append(observe_drop(drop, track))
    dust = []
    for scan in campaign.scans[:scans]:
        depth = np.arange(2 * ROW_STEP, ROW_DEPTH, ROW_STEP)
        setting, place = truth.setting(scan.projectile.simulated, 0.5, hidden.p_m), places[scan.name]
        setting, instrument = truth.apply(hidden.effects, setting, place), truth.instrument(hidden, place)
        level = instrument.stated_filling_factor(initial_filling_factor(setting, depth))
        seen = level + laboratory.dust * rng.standard_normal(depth.size)
        blur = scan.voxel * math.exp(laboratory.point_spread * rng.standard_normal())
        spread = blur + instrument.ct_blur
        dust.append(UndisturbedDust(scan, depth, seen, np.full(depth.size, ROW_NOISE), spread))
    maps = [_scan(truth, hidden, template, rng, laboratory) for template in truth.templates]
    return Measurements(judge_noise(drops), maps, dust)


def _scan(
    truth: TruthTable,
    hidden: Hidden,
    template: ReducedScan,
    rng: np.random.Generator,
    laboratory: Laboratory,
) -> ReducedScan:
    """The map of one bead of this truth: its speed, sample, lift and noise drawn anew, in the frame of the template's bead.

    The dust keeps its place about the tip, which the template's frame follows: the lift moves what the map says of the depth. A
    wider point spread is measured at the bead's edge as it is.
    """
    scan, place = template.scan, list_places(truth.campaign)[template.scan.name]
    instrument = truth.instrument(hidden, place)
    speed = scan.speed.value + laboratory.scan_speeds * scan.speed.sigma * rng.standard_normal()
    log_p_m = math.log(hidden.p_m) + laboratory.samples * rng.standard_normal()
    features = truth.map_features(hidden, scan, log_p_m, math.log(speed))
    tip = math.exp(features[0]) - laboratory.lift * rng.exponential()
    frame = replace(template.map, z=template.map.z - (tip - template.map.tip_depth), tip_depth=tip)
    seen = features[1:].reshape(frame.filling_factor.shape) * instrument.ct_scale
    noise = laboratory.maps * np.nan_to_num(frame.sigma) * rng.standard_normal(seen.shape)
    blur = template.point_spread + instrument.ct_blur
    return replace(template, map=replace(frame, filling_factor=seen + noise), blur=blur)


def _film(
    truth: TruthTable,
    hidden: Hidden,
    drop: Drop,
    instrument: Instrument,
    log_p_m: float,
    rng: np.random.Generator,
    laboratory: Laboratory,
) -> Track:
    camera, height = drop.camera, drop.height
    assert camera is not None and height is not None
    true_height = height.value + laboratory.heights * height.sigma * rng.standard_normal()
    fall = math.sqrt(2 * STANDARD_GRAVITY * max(true_height, 0.4 * height.value))
    speed = fall * (1 + laboratory.guide * rng.standard_normal())
    features = truth.features(hidden, drop.projectile, log_p_m, math.log(speed))
    contact = CONTACT + laboratory.contacts * rng.uniform(-0.5, 0.5)
    end = (contact + AFTER_STOP * math.exp(features[1])) * instrument.rate_factor
    frames = np.arange(int(end * camera.frame_rate))
    time = frames / camera.frame_rate
    row_error = laboratory.surfaces * camera.surface_row_sigma * rng.standard_normal()
    instant = Instant(contact, math.log(speed), row_error * camera.pixel_size)
    offset = instrument.row_offset_px * camera.pixel_size
    depth = predict_depth(features, time, instant, instrument, offset)
    sigma = drop.record.row_sigma or 0.08
    row = camera.surface_row + depth / camera.pixel_size
    row = row + laboratory.rows * sigma * rng.standard_normal(frames.size)
    stray = rng.random(frames.size) < laboratory.outliers
    row = np.where(stray, row + rng.uniform(-20, 20, frames.size), row)
    keep = rng.random(frames.size) >= laboratory.missing
    frames, time, row = frames[keep], time[keep], row[keep]
    n = frames.size
    return Track(frames, time, row, np.full(n, sigma), np.ones(n, dtype=bool), ("",) * n)
