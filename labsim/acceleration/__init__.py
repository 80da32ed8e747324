"""An accelerometer's record as what the projectile feels: specific force against time, contact, stop, and the depth between.

A sensor at rest feels gravity upwards, in free flight nothing, in the dust the force on the projectile over its mass. Input: a
record, and what drop.toml says of its sensors. Output: SI, upwards positive. The depth is integrated for people and for a
start; the likelihood compares the acceleration itself (inference/observations/acceleration_model.py).

One file a format, found by listing this folder: ``SUFFIXES`` that it reads and ``read(path, accelerometer) -> Readings``. What
no format claims is a table with named columns (``table.py``).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..errors import CampaignError, MeasurementError
from ..extensions import list_modules
from ..records import ALWAYS, STANDARD_GRAVITY, Accelerometer, Drop, FloatArray, Measured, Sensor
from ..tables import Table

UNITS = {"g": STANDARD_GRAVITY, "m/s^2": 1.0}
FEWEST = 30  # samples
LARGEST = 1e9  # s, or units of a reading; beyond it nothing is believed
NEAR_RANGE = 0.99  # of the range, from where a sensor is taken as saturated
SHORT, LONG = 1e-7, 2e-3  # s, between which a sampling interval of an impact is believed
SEEN = 5.0  # standard deviations: of a reading that is more than noise
ZERO = 4.0  # the same of a zero that is off
LOST = 1.5  # sampling intervals: a longer one is a gap
FLIGHT = 5  # samples of rest and of flight that a release takes
RELEASE = 10.0  # ln of the odds
BENT = 0.05  # of the rise to half the largest reading: what a line through it misses contact by, for the force of a tip bends
# of gravity: a level that is further off is no offset but another unit, sign or rest; a zero known less well is not known
REST = 0.5
SAME = 0.25  # of gravity: within it levels are one


@dataclass(frozen=True)
class Readings:
    """What a format's reader finds. time : s, (n,); values : m/s², (n, sensors), in the order of the accelerometer's sensors, NaN
    where nothing was read; ranges : m/s², one a sensor, inf where the file states none."""

    time: FloatArray
    values: FloatArray
    ranges: tuple[float, ...]


@dataclass(frozen=True)
class Acceleration:
    """One record. time (s), felt (m/s², upwards, gravity felt at rest), sigma (m/s²), sensor (its number) : (n,), of samples
    that a sensor within its range gave. step : s, of the sampling; saturated, lost : samples that no sensor gave."""

    time: FloatArray
    felt: FloatArray
    sigma: FloatArray
    sensor: np.ndarray
    step: float
    saturated: int
    lost: int


@dataclass(frozen=True)
class Impact:
    """What one record says of its drop without any simulation.

    contact_time, released : s on the record's clock, released is NaN where no release is seen; flight, rest : m/s², felt in
    free flight and after the stop (NaN where the record has none), should be 0 and gravity; flight_speed : m/s, from the time
    between release and contact; rebound_speed : m/s, upwards, the largest up to twice the stopping time, NaN where the record
    ends before. time (s, from contact), speed (m/s), depth, depth_sigma (m) : (n,).
    """

    contact_time: float
    released: float
    flight: Measured
    rest: Measured
    flight_speed: Measured | None
    impact_speed: Measured
    speed_source: str
    time: FloatArray
    speed: FloatArray
    depth: FloatArray
    depth_sigma: FloatArray
    stopping_time: float  # s, NaN where the record ends before
    penetration_depth: Measured
    rebound_speed: Measured
    warnings: tuple[str, ...]


def read_accelerometer(table: Table) -> Accelerometer:
    """The keys of ``[record]`` that say what the sensors are. Raises CampaignError."""
    unit = UNITS[table.choice("unit", tuple(UNITS))]
    at_rest = table.number("reads_at_rest", 0.0, 1.0)
    if at_rest not in (0.0, 1.0):
        raise table.wrong(
            "reads_at_rest",
            f"{at_rest:g} is neither; write 1.0 where a sensor at rest reads 1 g upwards, 0.0 where nothing",
        )
    columns = table.get("acceleration_column")
    columns = columns if isinstance(columns, list) else [columns]
    if not columns or not all(isinstance(name, str) and name.strip() for name in columns):
        raise table.wrong(
            "acceleration_column", f'{columns!r} is not a column\'s name or a list of names; write "a_g"'
        )
    if len(set(columns)) < len(columns):
        raise table.wrong("acceleration_column", f"{columns!r} names a column twice; each is one sensor")
    top = 1e6 / unit
    sigma = _each(table, "sigma", 1e-9 / unit, top, len(columns))
    offset = _each(table, "offset_sigma", 0.0, top, len(columns))
    scale = _each(table, "scale_sigma", 0.0, 0.5, len(columns))
    reach = _each(table, "range", 1e-3, top, len(columns), math.inf)
    sensors = [
        Sensor(name, s * unit, o * unit, c, r * unit)
        for name, s, o, c, r in zip(columns, sigma, offset, scale, reach, strict=True)
    ]
    return Accelerometer(
        table.text("time_column", ""),
        tuple(sorted(sensors, key=lambda each: each.range)),
        unit,
        at_rest * STANDARD_GRAVITY,
        _read_window(table),
    )


def _read_window(table: Table) -> tuple[float, float]:
    """The seconds on the record's clock that are this drop's; all where none are stated."""
    if not table.has("window_s"):
        return ALWAYS
    return table.span("window_s", -LARGEST, LARGEST, write="two times as [12.3, 12.8]", first="earlier time")


def _each(
    table: Table, key: str, low: float, high: float, count: int, default: float | None = None
) -> list[float]:
    """One number a sensor; a single one holds for all."""
    value = table.get(key) if default is None else table.get(key, default)
    values = value if isinstance(value, list) else [value] * count
    if len(values) != count:
        raise table.wrong(key, f"has {len(values)} numbers for {count} columns; give one, or one a column")
    for each in values:
        if not (default is not None and each is default):
            table.check_number(key, each, low, high)
    return [float(each) for each in values]


def check_acceleration(path: Path, accelerometer: Accelerometer) -> Accelerometer:
    """See that a record can be read and holds an impact, before anything is computed.

    Returns the accelerometer with the ranges that the file states where drop.toml states none, and with the zeros that the
    flight shows where they are not known. Raises CampaignError.
    """
    try:
        found = _read(path, accelerometer)
        ranges = [
            stated if math.isinf(each.range) else each.range
            for each, stated in zip(accelerometer.sensors, found.ranges, strict=True)
        ]
        order = sorted(range(len(ranges)), key=ranges.__getitem__)
        sensors = tuple(replace(accelerometer.sensors[k], range=ranges[k]) for k in order)
        accelerometer = replace(accelerometer, sensors=sensors)
        found = Readings(found.time, found.values[:, order], tuple(found.ranges[k] for k in order))
        if any(each.offset_sigma > REST * STANDARD_GRAVITY for each in sensors):
            accelerometer = _set_zeros(path, accelerometer, found)
        find_contact(_select(path, accelerometer, found), accelerometer, path)
    except MeasurementError as trouble:
        raise CampaignError(trouble.where, trouble.key, trouble.message) from None
    return accelerometer


def read_acceleration(path: Path, accelerometer: Accelerometer) -> Acceleration:
    """The samples, each from the finest sensor that is within its range. Raises MeasurementError."""
    return _select(path, accelerometer, _read(path, accelerometer))


def _read(path: Path, accelerometer: Accelerometer) -> Readings:
    formats = list_modules(__name__, "labsim.acceleration_formats")
    claimed = (m for m in formats.values() if path.suffix.lower() in getattr(m, "SUFFIXES", ()))
    found: Readings = next(claimed, formats["table"]).read(path, accelerometer)
    if found.time.size < FEWEST:
        raise MeasurementError(
            path, "record.file", f"has {found.time.size} samples; an impact takes {FEWEST} or more"
        )
    begin, end = accelerometer.window
    inside = (found.time >= begin) & (found.time <= end)
    if inside.sum() < FEWEST:
        raise MeasurementError(
            path,
            "record.window_s",
            f"holds {inside.sum()} samples and an impact takes {FEWEST}; choose seconds that the record has, which goes from "
            f"{found.time.min():g} to {found.time.max():g} s",
        )
    found = Readings(found.time[inside], found.values[inside], found.ranges)
    largest = float(np.nanmax(np.abs(found.values), initial=0.0)) / accelerometer.unit
    if max(largest, float(np.abs(found.time).max())) > LARGEST:
        raise MeasurementError(
            path, "record.file", f"holds numbers beyond {LARGEST:g}; they are no seconds and no g"
        )
    return found


def _select(path: Path, accelerometer: Accelerometer, found: Readings) -> Acceleration:
    time, readings = found.time, found.values
    clock = accelerometer.time_column or "time"
    steps = np.diff(time)
    if not np.all(steps > 0):
        at = int(np.argmin(steps > 0))
        raise MeasurementError(
            path,
            clock,
            f"does not rise after {time[at]:g} s; keep one record, sorted by its time",
        )
    step = float(np.median(steps))
    if not SHORT <= step <= LONG:
        raise MeasurementError(
            path,
            clock,
            f"has a sample every {step:g} s, outside {SHORT:g} to {LONG:g}; "
            + ("the column is in seconds" if accelerometer.time_column else "name a sensor that samples so"),
        )
    sensor = np.full(time.size, -1)
    felt = np.full(time.size, math.nan)
    for k, each in enumerate(accelerometer.sensors):
        good = np.isfinite(readings[:, k]) & (np.abs(readings[:, k]) < NEAR_RANGE * each.range) & (sensor < 0)
        sensor[good] = k
        felt[good] = readings[good, k] - each.zero
    use = sensor >= 0
    if use.sum() < FEWEST:
        raise MeasurementError(
            path, "range", f"leaves {int(use.sum())} samples of {use.size}; check unit and range"
        )
    beyond = ~use & np.any(np.isfinite(readings), axis=1)
    sigma = np.array([each.sigma for each in accelerometer.sensors])
    felt += STANDARD_GRAVITY - accelerometer.reads_at_rest
    lost = int(np.sum(np.maximum(np.round(steps / step) - 1, 0))) + int(np.sum(~use & ~beyond))
    return Acceleration(time[use], felt[use], sigma[sensor[use]], sensor[use], step, int(beyond.sum()), lost)


def _set_zeros(path: Path, accelerometer: Accelerometer, found: Readings) -> Accelerometer:
    """With the zero of each sensor whose own is not known, so that in flight it feels nothing. Raises MeasurementError."""
    sensors = []
    for each, values in zip(accelerometer.sensors, found.values.T, strict=True):
        if each.offset_sigma > REST * STANDARD_GRAVITY:
            level = _find_flight(path, each, values[np.isfinite(values)])
            zero = level.value + STANDARD_GRAVITY - accelerometer.reads_at_rest
            each = replace(each, zero=zero, offset_sigma=level.sigma)
        sensors.append(each)
    return replace(accelerometer, sensors=tuple(sensors))


def _find_flight(path: Path, sensor: Sensor, values: FloatArray) -> Measured:
    """What a sensor reads (m/s²) in the last spell at the lowest level before the impact: held, it would read gravity more."""
    usual = float(np.median(values)) if values.size else 0.0
    peak = int(np.argmax(np.abs(values - usual))) if values.size else 0
    if peak >= 2 * FLIGHT:
        means = np.convolve(values[:peak], np.full(FLIGHT, 1 / FLIGHT), "valid")
        lowest = int(np.argmin(means))
        near = (
            np.abs(means - means[lowest]) < SEEN * sensor.sigma / math.sqrt(FLIGHT) + SAME * STANDARD_GRAVITY
        )
        last = int(np.nonzero(near)[0][-1])
        begin = int(np.nonzero(~near[:last])[0].max(initial=-1)) + 1
        # the last mean may hold the first sample of the impact
        spell = values[begin : last + FLIGHT - 1]
        level = float(np.median(spell)) if spell.size >= FLIGHT else math.inf
        # a record that begins within the impact is lowest in the rise
        if abs(level - usual) < 0.5 * abs(values[peak] - usual):
            return Measured(level, 1.25 * sensor.sigma / math.sqrt(spell.size))
    raise MeasurementError(
        path,
        sensor.column,
        "shows no free flight before the impact, and offset_sigma says that its zero is not known; let the record begin earlier",
    )


def find_contact(record: Acceleration, accelerometer: Accelerometer, path: Path) -> int:
    """Number of the first sample of the impact: from there on, to the largest, the projectile feels more than noise.

    Raises MeasurementError where there is no impact, or one of the wrong sign.
    """
    sensor = accelerometer.sensors[0]
    felt, sigma = record.felt, record.sigma
    peak = int(np.argmax(felt))
    least = float(np.min(felt))
    if -least > felt[peak]:
        turned = "" if accelerometer.time_column else f': write "{_turn(sensor.column)}"'
        raise MeasurementError(
            path,
            sensor.column,
            f"is largest downwards ({least / STANDARD_GRAVITY:.3g} g): an impact reads upwards; turn its sign{turned}",
        )
    floor = SEEN * sigma + ZERO * max(each.offset_sigma for each in accelerometer.sensors)
    if felt[peak] < 2 * STANDARD_GRAVITY or felt[peak] < 3 * floor[peak]:
        raise MeasurementError(
            path,
            sensor.column,
            f"never feels more than {felt[peak] / STANDARD_GRAVITY:.3g} g: no impact stands out; check unit and reads_at_rest",
        )
    # before an impact the projectile feels little for a while: the last quiet spell in front of the largest reading
    quiet = felt[:peak] < np.maximum(floor[:peak], 0.02 * felt[peak])
    spell = np.convolve(quiet, np.ones(3), "valid") == 3 if peak >= 3 else np.empty(0)
    if not np.any(spell):
        level = float(np.median(felt[: max(peak, 1)]))
        raise MeasurementError(
            path,
            sensor.column,
            f"shows no free flight before the impact (it feels {level / STANDARD_GRAVITY:.3g} g there instead of 0); let the "
            "record begin earlier, or correct reads_at_rest and unit",
        )
    return int(np.nonzero(spell)[0][-1]) + 3


def _turn(column: str) -> str:
    """A sensor's name with the other sign, of a file whose numbers nobody edits."""
    return column[1:] if column.startswith("-") else f"-{column}"


def find_impact(record: Acceleration, drop: Drop) -> Impact:
    """Contact, speed, depth and stop of one record, with what looks odd. Raises MeasurementError."""
    accelerometer, path = drop.accelerometer, drop.record.path
    assert accelerometer is not None and path is not None
    first = find_contact(record, accelerometer, path)
    time, felt = record.time, record.felt
    offset = max(each.offset_sigma for each in accelerometer.sensors)
    peak = int(np.argmax(felt))
    released, release_sigma, flight = _find_release(record, first)
    # at the sensor's own zero, as free flight shows it, where that is known better than it is stated
    zero = flight.value if flight.sigma < offset else 0.0
    zero_sigma = min(offset, flight.sigma)
    floor = max(SEEN * float(record.sigma[first]) + zero_sigma, 0.02 * float(felt.max()))
    quiet = np.nonzero(felt[: first + 1] - zero < floor)[0]
    first = int(quiet[-1]) + 1 if quiet.size else first
    contact, contact_sigma = _refine(record, first, zero, floor)
    # a sample is the mean over its interval: what it takes up is exact at the edges, wherever in it contact lies
    edges = np.concatenate(
        [[time[0] - 0.5 * record.step], 0.5 * (time[1:] + time[:-1]), [time[-1] + 0.5 * record.step]]
    )
    first = max(int(np.searchsorted(edges, contact)) - 1, 0)
    warnings = []
    if record.saturated:
        warnings.append(f"{record.saturated} samples lie beyond the range of every sensor and are left out")
    if record.lost:
        warnings.append(f"{record.lost} samples are missing")
    allowed = ZERO * math.hypot(offset, flight.sigma)
    if abs(flight.value) > REST * STANDARD_GRAVITY:
        raise MeasurementError(
            path,
            "reads_at_rest",
            f"is contradicted: free flight feels {flight.value / STANDARD_GRAVITY:.3g} g instead of 0; correct it, or unit",
        )
    if abs(flight.value) > max(allowed, 0.01 * STANDARD_GRAVITY):
        warnings.append(
            f"free flight feels {flight.value / STANDARD_GRAVITY:.3f} g instead of 0, more than offset_sigma says; check the zero"
        )
    flight_speed = None
    if math.isfinite(released):
        fallen = STANDARD_GRAVITY * (contact - released)
        flight_speed = Measured(
            fallen,
            STANDARD_GRAVITY * math.hypot(release_sigma, 2 * record.step, 0.2 * (time[peak] - contact)),
        )
    clock = np.append(0.0, edges[first + 1 :] - contact)
    taken = np.append(0.0, np.cumsum((felt[first:] - zero) * np.diff(edges[first:])))
    given_up = taken - STANDARD_GRAVITY * clock
    speed, source = _choose_speed(drop, flight_speed, given_up)
    sensors = accelerometer.sensors
    scale = max(each.scale_sigma for each in sensors)
    velocity = speed.value - given_up
    # errors leave a rest of speed at the stop: it is over where that is small and the force gone
    doubt = np.sqrt(
        speed.sigma**2 + (scale * given_up) ** 2 + (zero_sigma * clock) ** 2 + (0.02 * speed.value) ** 2
    )
    highest = np.maximum.accumulate(felt[first:])
    gone = np.append(felt[first:] < 0.5 * highest, False)
    stopped = np.nonzero((velocity <= 0.0) | (gone & (velocity < 3 * doubt)))[0]
    last = int(stopped[0]) if stopped.size else clock.size - 1
    stop = math.nan
    if stopped.size and velocity[last] <= 0.0:
        last = max(last, 1)
        before, after = velocity[last - 1], velocity[last]
        stop = float(clock[last - 1] + (clock[last] - clock[last - 1]) * before / max(before - after, 1e-12))
    elif stopped.size:  # within the sample in which the force breaks off
        share = float(np.clip(felt[first + last] / highest[last], 0.0, 1.0))
        last += 1
        stop = float(clock[last - 1] + share * (clock[last] - clock[last - 1]))
    if stopped.size:
        later, moving = clock[last:].copy(), velocity[last:].copy()
        clock[last], velocity[last] = stop, max(float(velocity[last]), 0.0)
    depth = np.concatenate([[0.0], np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * np.diff(clock))])

    def twice(rate: FloatArray) -> FloatArray:
        return np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(clock))])

    fall = twice(taken)
    depth_sigma = np.sqrt(
        (speed.sigma * clock) ** 2 + (speed.value * contact_sigma) ** 2 + (0.5 * zero_sigma * clock**2) ** 2 + (scale * fall) ** 2
        + (record.sigma[min(first, felt.size - 1)] ** 2 * record.step * np.maximum(clock, 0.0) ** 3 / 3)
    )  # fmt: skip
    rest = rebound = Measured(math.nan, math.nan)
    if stopped.size and later[-1] >= 2.0 * stop:
        at = int(np.argmin(moving[later <= 2.0 * stop]))
        rebound = Measured(float(-moving[at]), float(doubt[last + at]))
    if stopped.size:
        after = felt[time - contact > 2.0 * stop]
        if after.size >= 10:
            rest = Measured(float(np.median(after)), float(1.25 * np.std(after) / math.sqrt(after.size)))
            off = rest.value - STANDARD_GRAVITY
            if abs(off) > max(
                4 * math.hypot(offset, scale * STANDARD_GRAVITY, rest.sigma), 0.02 * STANDARD_GRAVITY
            ):
                warnings.append(
                    f"after the stop it feels {rest.value / STANDARD_GRAVITY:.3f} g instead of 1; check unit, offset_sigma and "
                    "reads_at_rest"
                )
    else:
        warnings.append(
            "ends, by its own integral, before the projectile stops; the depth is that at its end"
        )
    short = abs(speed.value - float(given_up[last])) if not stopped.size else 0.0
    if short > 0.3 * speed.value:
        warnings.append(
            f"takes up only {given_up[last]:.3g} of {speed.value:.3g} m/s ({source}); check unit, scale and whether it is whole"
        )
    for text, stated in (("height_mm", _fall_speed(drop)), ("impact_speed_m_s", drop.impact_speed)):
        if stated is None or flight_speed is None:
            continue
        if abs(stated.value - flight_speed.value) > max(
            4 * math.hypot(stated.sigma, flight_speed.sigma), 0.02 * stated.value
        ):
            warnings.append(
                f"the flight lasts {(contact - released) * 1e3:.4g} ms, thus {flight_speed.value:.3f} m/s at contact, but "
                f"{text} says {stated.value:.3f} ± {stated.sigma:.3f} m/s"
            )
    return Impact(
        contact, released, flight, rest, flight_speed, speed, source,
        clock[: last + 1], velocity[: last + 1], depth[: last + 1], depth_sigma[: last + 1],
        stop, Measured(float(depth[last]), float(depth_sigma[last])), rebound, tuple(warnings),
    )  # fmt: skip


def _refine(record: Acceleration, first: int, zero: float, floor: float) -> tuple[float, float]:
    """Contact (s) and its error: where the line through the rise, up to half the largest reading, meets the zero (m/s²).

    Contact lies in the first sample above the noise, or in the one before it where the rise is lost in the noise.
    """
    time, felt, step = record.time, record.felt - zero, record.step
    peak = first + int(np.argmax(felt[first:]))
    rising = first + np.nonzero((felt[first:peak] > floor) & (felt[first:peak] < 0.5 * felt[peak]))[0]
    if rising.size < 2:  # a blunt tip, or a slow sensor
        rising = np.array([first, min(first + 1, peak)])
    slope = 0.0
    if rising[-1] > rising[0]:
        slope, height = np.polyfit(time[rising] - time[first], felt[rising], 1)
    begin = float(time[first] - 0.5 * step)
    if slope <= 0.0:
        return max(begin, float(time[0])), 0.5 * step
    contact = max(
        float(np.clip(time[first] - height / slope, begin - floor / slope, begin + step)), float(time[0])
    )
    noise = float(record.sigma[first]) / slope / math.sqrt(rising.size)
    return contact, math.hypot(0.25 * step, noise, BENT * (float(time[rising[-1]]) - contact))


def _find_release(record: Acceleration, first: int) -> tuple[float, float, Measured]:
    """When the projectile was let go (s; NaN where the record begins in flight), with its error, and what is felt from there on.

    The most likely step from gravity to nothing in white noise; one that is not e^RELEASE times likelier than none is no release.
    """
    felt, time, step = record.felt[: max(first - 1, 0)], record.time, record.step
    if felt.size < 2 * FLIGHT:
        level = float(np.mean(felt)) if felt.size else 0.0
        return math.nan, math.nan, Measured(level, float(record.sigma[0]) / math.sqrt(max(felt.size, 1)))
    sigma = max(float(np.mean(record.sigma[: felt.size])), 1e-3 * STANDARD_GRAVITY)
    gain = np.cumsum(felt - 0.5 * STANDARD_GRAVITY) * STANDARD_GRAVITY / sigma**2
    at = int(np.argmax(gain[:-FLIGHT]))
    held = gain[at] > RELEASE and at >= FLIGHT
    free = felt[at + 1 :] if held else felt
    flight = Measured(float(np.mean(free)), max(float(np.std(free)), sigma) / math.sqrt(free.size))
    if not held:
        return math.nan, math.nan, flight
    return float(time[at] + 0.5 * step), step * max(1.0, 2 * (sigma / STANDARD_GRAVITY) ** 2), flight


def _fall_speed(drop: Drop) -> Measured | None:
    """What the stated height gives, m/s."""
    if drop.height is None or drop.height.value <= 0:
        return None
    speed = math.sqrt(2 * STANDARD_GRAVITY * drop.height.value)
    return Measured(speed, 0.5 * speed * drop.height.sigma / drop.height.value)


def _choose_speed(drop: Drop, flight: Measured | None, given_up: FloatArray) -> tuple[Measured, str]:
    """The best known impact speed; where nothing gives one, what the impact takes up at most."""
    known = [
        (speed, source)
        for speed, source in (
            (drop.impact_speed, "stated"),
            (flight, "from the flight"),
            (_fall_speed(drop), "from the height"),
        )
        if speed is not None
    ]
    if known:
        return min(known, key=lambda each: each[0].sigma)
    most = float(np.max(given_up))
    return Measured(max(most, 1e-3), 0.05 * max(most, 1e-3)), "taken up by the impact"
