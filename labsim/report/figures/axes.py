"""Single pictures on matplotlib axes, for scripts and notebooks: a curve, a map, a posterior."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from ...records import FloatArray
from .style import BLUE, GREY, INK, PHI


def plot_depth(curve: pd.DataFrame, ax: Axes | None = None) -> Axes:
    """Depth below the undisturbed surface (mm, downwards) against time since contact (ms). curve : columns of curve.csv."""
    ax = plt.gca() if ax is None else ax
    time, depth = 1e3 * curve["time_s"], 1e3 * curve["depth_m"]
    if "depth_sigma_m" in curve:
        sigma = 1e3 * curve["depth_sigma_m"]
        ax.fill_between(time, depth - sigma, depth + sigma, color=BLUE, alpha=0.3, lw=0, label="one sigma")
    ax.plot(time, depth, color=BLUE)
    ax.axhline(0.0, color=GREY, lw=0.8)
    ax.set(xlabel="time since contact (ms)", ylabel="depth (mm)")
    if not ax.yaxis_inverted():
        ax.invert_yaxis()
    return ax


def plot_filling_factor(found: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Filling factor on both sides of the axis, in the colours of simulated fields. found : as map.nc holds it."""
    ax = plt.gca() if ax is None else ax
    r, z, phi = 1e3 * found["r"].values, 1e3 * found["z"].values, found["phi"].values
    image = ax.pcolormesh(
        np.concatenate([-r[::-1], r]),
        z,
        np.concatenate([phi[:, ::-1], phi], axis=1),
        shading="nearest",
        **PHI,
    )
    ax.figure.colorbar(image, ax=ax, label="filling factor", extend="both")
    radius, tip = 1e3 * found.attrs["bead_radius_m"], 1e3 * found.attrs["tip_depth_m"]
    ax.add_patch(Circle((0.0, radius - tip), radius, fill=False, ec=INK, lw=1.0))
    ax.axhline(0.0, color=GREY, lw=0.8, ls="--")
    ax.set(
        aspect="equal",
        xlabel="distance from the axis (mm)",
        ylabel="height above the undisturbed surface (mm)",
    )
    return ax


def plot_density(draws: FloatArray, name: str, ax: Axes | None = None) -> Axes:
    """Histogram of a posterior with the ends of its 90 % interval. name : of the parameter; p_m_Pa is drawn in kPa."""
    ax = plt.gca() if ax is None else ax
    pressure = name.endswith("_Pa")
    values = draws / 1e3 if pressure else draws
    ax.hist(values, bins=60, density=True, color=BLUE, alpha=0.5)
    for end in np.quantile(values, [0.05, 0.95]):
        ax.axvline(end, color=INK, lw=0.8, ls="--")
    shown = "$p_\\mathrm{m}$" if name == "p_m_Pa" else name.removesuffix("_Pa").replace("_", " ")
    ax.set(
        xlabel=f"{shown} (kPa)" if pressure else shown, ylabel="posterior density; dashed: 90 %", yticks=[]
    )
    return ax
