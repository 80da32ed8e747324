"""The published drops of Güttler et al. (2009) against the model and every effect of the catalogue: docs/seed-study.md.

    python -m benchmarks.seed.study [--store FOLDER] [--minutes 30] [--only nominal planar ...]

Runs what is missing (the order is that of ``plan``, most wanted first), stops at the time given, writes every run that
there is to docs/seed-study.csv and prints the tables of the page from that file. Start it again and it goes on. A row whose
run the store lacks, because the solver has changed since, stays as it is: ``solver`` says whose it is.
``--tables`` only prints; ``--again`` runs a sample of the rows with the solver of today and prints how far they are off.
The round drops take four spacings a tip radius, which is coarse: ``--only error`` measures it.
"""

from __future__ import annotations

import argparse
import csv
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from labsim.effects import list_effects, list_places, reference_campaign
from labsim.inference.published.planar import planar_setting
from labsim.records import Material, Projectile
from labsim.runs.run_file import FailedRun
from labsim.runs.store import RunStore
from labsim.sph import DropRun, DropSetting

TABLE = Path(__file__).parents[2] / "docs" / "seed-study.csv"
GLASS = 2540.0  # kg/m^3, published for the simulated cylinder; the projectiles have a bead's mass (published)
SMALL, LARGE = 0.5e-3, 1.5e-3  # m, published radii
BULK_MODULUS = 45.0e3  # Pa, assumed (the paper gives none); scanned
CELLS = 4  # spacings a tip radius of the round drops
PLANAR_CELLS = 5.5  # as the shipped campaign
P_M = (125.0, 250.0, 500.0, 1000.0, 2000.0)  # Pa, nominal model
P_M_PLANAR = (162.5, 325.0, 650.0, 1300.0, 2600.0, 5200.0)
P_M_EFFECT = (250.0, 1000.0)  # Pa, where effects are run
SPEEDS = (0.0394, 0.07, 0.118, 0.197, 0.345, 0.591, 1.034, 1.77)  # m/s: m v/A 0.2 to 3 for both radii
MOMENTA = (1.0, 1.75)  # kg/(m s): the drops that effects are judged by
STOPS = (0.01, 0.02, 0.05, 0.1, 0.15)  # m/s, speeds below which a projectile may be called at rest
FILLING = (0.17, 0.18, 0.19, 0.20, 0.21, 0.22, 0.23, 0.25, 0.27)  # thresholds of compacted volume
LEVELS = {  # effect -> values of its parameters that are run besides null
    "gravity": ({"g": 9.81},),
    "shear_strength": ({"factor": 0.4}, {"factor": 2.0}),
    "strength_rate": ({"eta": 0.06}, {"eta": 0.4}),
    "surface_crust": ({"excess": -0.0255, "length": 0.3e-3}, {"excess": 0.05, "length": 0.3e-3}),
    "density_gradient": ({"gradient": 12.0}, {"gradient": -2.5}),
    "side_friction": ({"force_per_length": 0.35}, {"force_per_length": 1.0}),
    "contact_friction": ({"mu": 0.3}, {"mu": 0.8}),
    "strength_slope": ({"delta": 0.85}, {"delta": 0.4}),
    "pore_gas": ({"P0": 5000.0}, {"P0": 20000.0}),
    "hard_floor": ({"depth": 2.0e-3}, {"depth": 1.6e-3}),
    "bulk_modulus": ({"K0": 6.0e3}, {"K0": 300.0e3}),
    "artificial_viscosity": ({"alpha": 2.0}, {"alpha": 0.1}),
    "strength_ceiling": ({"phi_2": 0.40}, {"phi_2": 0.72}),
    "filling_factor": ({"phi_0": 0.16}, {"phi_0": 0.14}),
    "projectile_mass": ({"factor": 1.3}, {"factor": 0.8}),
    "tensile_strength": ({"factor": 3.0},),
}
TOGETHER: tuple[
    tuple[dict[str, float], float], ...
] = (  # amplitudes and p_m (Pa) that the tables call best, run as they stand
    ({"hard_floor": 1.81e-3}, 427.0),
    ({"shear_strength": 0.793}, 753.0),
    ({"filling_factor": 0.142}, 692.0),
    ({"side_friction": 0.09}, 312.0),
    ({"strength_slope": 0.715}, 909.0),
    ({"contact_friction": 0.12}, 427.0),
    ({"pore_gas": 200.0}, 506.0),
    ({"tensile_strength": 1.69}, 306.0),
    ({"pore_gas": 556.0, "hard_floor": 1.73e-3}, 393.0),
    ({"shear_strength": 0.523, "side_friction": 0.444}, 769.0),
    ({"shear_strength": 0.457, "tensile_strength": 3.0}, 769.0),
    ({"surface_crust": -0.0255, "shear_strength": 0.894}, 722.0),
    ({"shear_strength": 0.4, "contact_friction": 0.8}, 1894.0),
    ({"gravity": 9.81, "shear_strength": 0.4}, 3199.0),
)
AGAIN = (  # group, case or beginning of it, radius in mm, speed in m/s, p_m in Pa: the sample that is run again
    ("nominal", "", 0.5, 0.197, 250.0),
    ("nominal", "", 0.5, 0.591, 500.0),
    ("nominal", "", 0.5, 1.77, 1000.0),
    ("nominal", "", 0.5, 0.07, 2000.0),
    ("bead", "", 0.5, 0.8, 1000.0),
    ("scaling", "", 1.5, 0.345, 500.0),
    ("planar", "", 0.5, 0.197, 1300.0),
    ("planar", "", 0.5, 0.591, 650.0),
    ("planar", "", 0.5, 1.034, 5200.0),
    ("planar_K0", "300000", 0.55, 0.65, 1300.0),
    ("gravity", "9.81", 1.5, 0.197, 250.0),
    ("side_friction", "0.35", 0.5, 1.033, 1000.0),
    ("hard_floor", "0.002", 0.5, 1.033, 250.0),
    ("shear_strength", "0.4", 1.5, 0.344, 1000.0),
    ("surface_crust", "-0.0255", 0.5, 0.591, 250.0),
    ("pore_gas", "5000", 1.5, 0.197, 1000.0),
)


@dataclass(frozen=True)
class Task:
    """One run: what it belongs to, the values of an effect as text, and the setting."""

    group: str
    case: str
    setting: DropSetting


def speed_at(momentum: float, radius: float) -> float:
    """Speed (m/s) of a bead of this radius (m) at m v/A (kg/(m s))."""
    return momentum / (4.0 / 3.0 * GLASS * radius)


def round_drop(
    radius: float, speed: float, p_m: float, tip: str = "hemisphere", cells: int = CELLS
) -> DropSetting:
    """A round projectile with the mass of a glass bead, into dust without gravity."""
    return DropSetting(
        projectile=Projectile(tip=tip, tip_radius=radius, mass=GLASS * 4.0 / 3.0 * math.pi * radius**3),  # type: ignore[arg-type]
        impact_speed=speed,
        material=Material(p_m=p_m, bulk_modulus=BULK_MODULUS),
        gravity=0.0,
        spacing=radius / cells,
        duration=80.0 * radius,
        after_stop=0.0,
        depth=None,
    )


def planar_drop(
    radius: float, speed: float, p_m: float, cells: float = PLANAR_CELLS, k0: float = BULK_MODULUS
) -> DropSetting:
    """The seed's cylinder in its box of 8 x 5 mm², scaled with the radius."""
    bead = round_drop(radius, speed, p_m).projectile
    return planar_setting(bead, speed, Material(p_m=p_m, bulk_modulus=k0), spacing=radius / cells)


def plan() -> Iterator[Task]:
    """All runs, most wanted first."""
    for p_m in P_M:
        for speed in SPEEDS:
            yield Task("nominal", "", round_drop(SMALL, speed, p_m))
    for p_m in P_M:
        yield Task("bead", "", round_drop(SMALL, 0.8, p_m, tip="sphere"))
    yield Task("scaling", "", round_drop(LARGE, SPEEDS[4], 500.0))
    yield Task("bulk", "", round_drop(SMALL, 0.8, 500.0))
    for p_m in P_M_PLANAR:
        for speed in SPEEDS:
            yield Task("planar", "", planar_drop(SMALL, speed, p_m))
    yield from _plan_effects()
    for k0 in (4.5e3, BULK_MODULUS, 300e3):  # the seed's own case
        yield Task("planar_K0", f"{k0:g}", planar_drop(0.55e-3, 0.65, 1300.0, cells=4, k0=k0))
    large = planar_drop(1.65e-3, 0.2, 1300.0, cells=4)
    yield Task("planar_box", "scaled", large)
    yield Task("planar_box", "8 x 5 mm", replace(large, width=8.0e-3, depth=5.0e-3))
    for k0 in (BULK_MODULUS, 300e3):
        drop = planar_drop(SMALL, 0.65, 1300.0, k0=k0)
        yield Task("planar_alpha", "1", drop.replace(numerics=replace(drop.numerics, alpha=1.0)))
    for radius, speed in ((SMALL, 0.591), (LARGE, 0.197)):
        drop = planar_drop(radius, speed, 1300.0)
        yield Task("planar_gravity", "9.81", drop.replace(gravity=9.81))
    for cells in (8,):
        for speed in (0.197, 0.65):
            yield Task("planar_error", f"{cells}", planar_drop(SMALL, speed, 1300.0, cells=cells))
    for width in (8.333, 12.0):
        drop = round_drop(LARGE, SPEEDS[4], 500.0)
        yield Task("wall", f"{width:g}", drop.replace(width=width * LARGE, depth=8.0 * LARGE))
    for k0 in (4.5e3, 300e3):
        for p_m in (250.0, 500.0, 1000.0):
            drop = round_drop(SMALL, 0.591, p_m)
            yield Task("K0", f"{k0:g}", drop.replace(material=drop.material.replace(bulk_modulus=k0)))
    for cells in (8, 12):
        for speed in (0.197, 0.345, 0.591, 1.034):
            yield Task("error", f"{cells}", round_drop(SMALL, speed, 500.0, cells=cells))

    yield from _plan_equal_speed()
    yield from _plan_together()


LENGTHS = {
    "gravity": 0,
    "surface_crust": 0,
    "density_gradient": 0,
    "hard_floor": 0,
}  # effects that bring a length or a time


def _plan_equal_speed() -> Iterator[Task]:
    """The further drops that could be made: 1 mm as slow as 3 mm was, and 3 mm as fast as 1 mm."""
    campaign = replace(reference_campaign(), gravity=0.0)
    effects, place = list_effects(campaign), list_places(campaign)["D01"]
    for case, level in LENGTHS.items():
        values = LEVELS[case][level]
        for p_m in P_M_EFFECT:
            for radius, speed in ((SMALL, 0.197), (LARGE, 0.591)):
                drop = effects[case].apply(round_drop(radius, speed, p_m), values, place)
                yield Task(f"{case}_next", f"{next(iter(values.values())):g}", drop)


def _plan_effects() -> Iterator[Task]:
    campaign = replace(reference_campaign(), gravity=0.0)
    effects, place = list_effects(campaign), list_places(campaign)["D01"]
    for number in (0, 1):  # a study that is cut short has one level of every effect
        for case, levels in LEVELS.items():
            if number >= len(levels):
                continue
            label = f"{next(iter(levels[number].values())):g}"
            for p_m in P_M_EFFECT:
                for radius in (SMALL, LARGE):
                    for momentum in MOMENTA:
                        drop = round_drop(radius, round(speed_at(momentum, radius), 3), p_m)
                        yield Task(case, label, effects[case].apply(drop, levels[number], place))


def name_together(chosen: dict[str, float]) -> str:
    return " + ".join(f"{name} {value:g}" for name, value in chosen.items())


def _plan_together() -> Iterator[Task]:
    """The best single effects and pairs as they stand: the four drops and the scanned bead; pairs at two more p_m."""
    campaign = replace(reference_campaign(), gravity=0.0)
    effects, place = list_effects(campaign), list_places(campaign)["D01"]
    for chosen, best in TOGETHER:
        case = name_together(chosen)
        for p_m in (best,) if len(chosen) == 1 else (best, 0.7 * best, 1.4 * best):
            drops = [
                round_drop(radius, round(speed_at(momentum, radius), 3), p_m)
                for radius in (SMALL, LARGE)
                for momentum in MOMENTA
            ]
            for drop in [*drops, round_drop(SMALL, 0.8, p_m, tip="sphere")]:
                for name, value in chosen.items():
                    values = {next(iter(LEVELS[name][0])): value}
                    if name == "surface_crust":
                        values["length"] = 0.3e-3
                    drop = effects[name].apply(drop, values, place)
                yield Task("together", case, drop)


COLUMNS = ("group", "case", "geometry", "tip", "radius_mm", "speed_m_s", "p_m_Pa", "K0_Pa", "cells", "depth_mm",
           "stopping_time_ms", *(f"time_below_{stop:g}_ms" for stop in STOPS), "sine_time_ms", "viscous_share", "solver",
           *(f"volume_above_{phi:g}" for phi in FILLING))  # fmt: skip


SETTING = COLUMNS[:9]


def describe_setting(task: Task) -> dict[str, str]:
    """The columns of a row that say what is run."""
    setting, radius = task.setting, task.setting.projectile.tip_radius
    row: dict[str, object] = {
        "group": task.group, "case": task.case, "geometry": setting.geometry, "tip": setting.projectile.tip,
        "radius_mm": radius * 1e3, "speed_m_s": setting.impact_speed, "p_m_Pa": setting.material.p_m,
        "K0_Pa": setting.material.bulk_modulus, "cells": radius / setting.spacing,
    }  # fmt: skip
    return _as_text(row)


def describe(task: Task, run: DropRun) -> dict[str, str]:
    """A row of the table. Volumes in volumes (planar: cross-sections) of the sphere."""
    setting, radius = run.setting, run.setting.projectile.tip_radius
    unit = math.pi * radius**2 if setting.geometry == "planar" else 4.0 / 3.0 * math.pi * radius**3
    row: dict[str, object] = {
        "depth_mm": run.penetration_depth * 1e3, "stopping_time_ms": run.stopping_time * 1e3,
        "sine_time_ms": sine_time(run) * 1e3, "viscous_share": run.viscous_share,
        "solver": run.solver,
    }  # fmt: skip
    for stop in STOPS:
        below = np.nonzero(run.velocity <= stop)[0]
        row[f"time_below_{stop:g}_ms"] = _crossing(run, int(below[0]), stop) * 1e3 if below.size else math.nan
    for phi in FILLING:
        row[f"volume_above_{phi:g}"] = run.compacted_volume(phi) / unit
    return {**describe_setting(task), **_as_text(row)}


def _as_text(row: dict[str, object]) -> dict[str, str]:
    return {key: f"{value:.5g}" if isinstance(value, float) else str(value) for key, value in row.items()}


def _crossing(run: DropRun, index: int, stop: float) -> float:
    if index == 0:
        return 0.0
    v0, v1 = run.velocity[index - 1], run.velocity[index]
    return float(run.time[index - 1] + (v0 - stop) / (v0 - v1) * (run.time[index] - run.time[index - 1]))


def sine_time(run: DropRun) -> float:
    """T (s) of the quarter sine z = D sin(π t / 2T) that is nearest to the curve until the stop."""
    keep = run.time <= run.stopping_time
    t, z = run.time[keep], run.depth[keep]
    best, chosen = math.inf, math.nan
    for trial in run.stopping_time * np.linspace(0.6, 1.6, 201):
        shape = np.sin(0.5 * math.pi * np.minimum(t / trial, 1.0))
        misfit = float(np.sum((z - shape * (shape @ z) / (shape @ shape)) ** 2))
        if misfit < best:
            best, chosen = misfit, float(trial)
    return chosen


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--store", type=Path, default=None)
    parser.add_argument("--minutes", type=float, default=30.0, help="no run is begun after this time")
    parser.add_argument("--only", nargs="*", help="groups to run; default all")
    parser.add_argument("--tables", action="store_true", help="print the tables only")
    parser.add_argument(
        "--again", action="store_true", help="run a sample of the rows with the solver of today"
    )
    options = parser.parse_args()
    if options.again:
        print(run_again(RunStore(options.store)))
        return
    if not options.tables:
        run_plan(RunStore(options.store), options.minutes, options.only)
    from benchmarks.seed import tables  # here, since it imports this file

    print(tables.report(TABLE))


def run_plan(store: RunStore, minutes: float, only: list[str] | None = None) -> None:
    """Make what is missing, then write all that is there; rows of runs that the store lacks stay."""
    began, rows, failed = time.monotonic(), [], 0
    stored = {_key(row): row for row in _read_rows()}
    for task in plan():
        run = store.find(task.setting)
        wanted = not only or task.group in only
        if run is None and wanted and time.monotonic() - began < 60 * minutes:
            run = store.get_many([task.setting], workers=1)[0]
            print(f"{time.monotonic() - began:6.0f} s  {task.group} {task.case}", flush=True)
        if isinstance(run, FailedRun) or (run is not None and not run.stopped):
            failed += 1
            print(f"did not stop: {task.group} {task.case} p_m {task.setting.material.p_m:g}", flush=True)
        elif run is not None:
            rows.append(describe(task, run))
        elif (old := stored.get(_key(describe_setting(task)))) is not None:
            rows.append(old)
    with TABLE.open("w", newline="") as stream:
        writer = csv.DictWriter(stream, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)
    print(f"{len(rows)} of {sum(1 for _ in plan())} runs in {TABLE.name}, {failed} without a stop")


def _read_rows() -> list[dict[str, str]]:
    if not TABLE.exists():
        return []
    with TABLE.open(newline="") as stream:
        return list(csv.DictReader(stream))


def _key(row: dict[str, str]) -> tuple[str, ...]:
    return tuple(row[name] for name in SETTING)


def run_again(store: RunStore) -> str:
    """The rows of AGAIN by the solver of today: ln D, ln T_s and the volume above φ = 0.20, less what the table holds."""
    tasks = {_key(describe_setting(task)): task for task in plan()}
    lines = ["group | case | radius, mm | speed, m/s | p_m, Pa | solver of the row | ln D | ln T_s | volume"]
    for row in _read_rows():
        known = (float(row["radius_mm"]), float(row["speed_m_s"]), float(row["p_m_Pa"]))
        if (row["group"], row["case"], *known) not in AGAIN:
            continue
        run = store.get_many([tasks[_key(row)].setting], workers=1)[0]
        if isinstance(run, FailedRun):
            raise RuntimeError(f"{row['group']} {row['case']}: {run}")
        new = describe(tasks[_key(row)], run)
        changes = [math.log(float(new[name]) / float(row[name])) for name in ("depth_mm", "stopping_time_ms")]
        volume = float(new["volume_above_0.2"]) - float(row["volume_above_0.2"])
        lines.append(
            f"{row['group']} | {row['case']} | {known[0]:g} | {known[1]:g} | {known[2]:g} | {row['solver'][:6]} | "
            f"{changes[0]:+.4f} | {changes[1]:+.4f} | {volume:+.3f}"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    main()
