"""The dust of a run as VTK files (ParaView, VisIt, PyVista) and its curve as a table."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pandas as pd

from ..sph import DropRun


def write_fields(run: DropRun, folder: Path) -> Path:
    """``stop.vtu`` (a vertex a particle, SI) and ``run.pvd``, which gives it its time; returns the .pvd."""
    folder.mkdir(exist_ok=True)
    dust = run.particles
    points = np.column_stack([dust.r, np.zeros_like(dust.r), dust.z])
    data = {
        field.name: getattr(dust, field.name)
        for field in dataclasses.fields(dust)
        if field.name not in ("r", "z", "speed_r", "speed_z")
    }
    data["velocity"] = np.column_stack([dust.speed_r, np.zeros_like(dust.r), dust.speed_z])
    cells = [("vertex", np.arange(len(points))[:, None])]
    meshio.Mesh(points, cells, point_data=data).write(folder / "stop.vtu")
    collection = folder / "run.pvd"
    collection.write_text(
        '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">\n  <Collection>\n'
        f'    <DataSet timestep="{run.stopping_time!r}" part="0" file="stop.vtu"/>\n  </Collection>\n</VTKFile>\n'
    )
    return collection


def write_curve(run: DropRun, path: Path) -> Path:
    """time_s, depth_m, velocity_m_s, force_N (planar: per metre of cylinder, force_N_m)."""
    force = "force_N_m" if run.setting.geometry == "planar" else "force_N"
    table = {
        "time_s": run.time,
        "depth_m": run.depth + 0.0,  # no -0 at contact
        "velocity_m_s": run.velocity,
        force: run.force,
    }
    pd.DataFrame(table).to_csv(path, index=False, float_format="%.9g")
    return path


def run_summary(run: DropRun) -> dict[str, Any]:
    """run.json of one run."""
    return {
        "penetration_depth_m": run.penetration_depth,
        "stopping_time_s": run.stopping_time,
        "stopped": run.stopped,
        "particles": run.particles.r.size,
        "steps": run.steps,
        "wall_s": run.wall,
        "updates_per_s": run.updates_per_s,
        "momentum_error": run.momentum_error,
        "energy_error": run.energy_error,
        "energies_J": run.energies,
        "viscous_share": run.viscous_share,
        "contact_energy_share": run.energy_share("contact"),
        "viscous_energy_share": run.energy_share("viscous"),
        "exchange_energy_share": run.energy_share("exchange"),
        "filling_factor_max": float(run.particles.filling_factor.max()),
        "compacted_volume_m3": {f"{phi:.2f}": run.compacted_volume(phi) for phi in (0.17, 0.20, 0.22)},
        "solver": run.solver,
        "setting": dataclasses.asdict(run.setting),
        "warnings": list(run.warnings),
    }
