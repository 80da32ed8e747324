"""Figures to hover over and zoom into, as plain Plotly data and layout. The page's script gives them the colours of its theme.

``meta`` of a trace is its role, which the script turns into a colour: measured, nominal, extended, band, noise.
"""

from __future__ import annotations

import html
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...inference.fits.posterior import Posterior
from ...records import FloatArray
from ..pages.drop_views import DropView
from ..pages.map_views import MapView
from .campaign import DIFFERENCE, say_projectile
from .style import PHI

ROLES = ("nominal", "extended")
SYMBOLS = ("circle", "square", "diamond", "triangle-up", "triangle-down", "star", "cross", "x")
SIGNS = ("●", "■", "◆", "▲", "▼", "★", "✚", "✖")  # the same, for the key above the figure
MARGIN = {"l": 54, "r": 12, "t": 26, "b": 42}
Spec = dict[str, Any]


def plot_drop(view: DropView) -> Spec:
    """Depth against time above, what is left below with the band of two standard deviations of a true model."""
    clock = view.clock * 1e3
    around = np.concatenate([clock, clock[::-1]])
    shown = view.shown
    band = 2 * shown.left_factor * view.allowed
    noise = np.full_like(clock, view.noise * shown.left_factor)
    data: list[Spec] = [
        _area(around, np.concatenate([band, -band[::-1]]), "band"),
        _area(around, np.concatenate([noise, -noise]), "noise"),
        {
            "type": "scatter", "mode": "markers", "x": clock, "y": view.measured * shown.factor, "meta": "measured",
            "name": "measured", "marker": {"size": 5}, "hovertemplate": f"%{{y:.4f}} {shown.unit}",
        },
    ]  # fmt: skip
    for role, (name, depth) in zip(ROLES, view.simulated.items(), strict=False):
        label = html.escape(name)
        data.append(
            {
                "type": "scatter", "mode": "lines", "x": clock, "y": depth * shown.factor, "meta": role, "name": label,
                "line": {"width": 1.8}, "hovertemplate": f"%{{y:.4f}} {shown.unit}",
            }
        )  # fmt: skip
        data.append(
            {
                "type": "scatter", "mode": "lines+markers", "x": clock, "y": view.left(name) * shown.left_factor, "meta": role,
                "name": f"left by {label}", "yaxis": "y2", "line": {"width": 1.1}, "marker": {"size": 3.5},
                "hovertemplate": f"%{{y:+.2f}} {shown.left_unit}",
            }
        )  # fmt: skip
    layout = {
        "height": 330,
        "margin": MARGIN | {"t": 8},
        "showlegend": False,
        "hovermode": "x unified",
        "xaxis": {"title": {"text": "time since contact (ms)"}, "anchor": "y2", "zeroline": False, "hoverformat": ".3f"},
        "yaxis": {
            "title": {"text": shown.label}, "domain": [0.42, 1.0], "zeroline": True,
            "autorange": "reversed" if shown.downwards else True,
        },
        "yaxis2": {"title": {"text": shown.left_label}, "domain": [0.0, 0.34], "zeroline": True},
    }  # fmt: skip
    return {"data": data, "layout": layout}


def _area(x: FloatArray, y: FloatArray, role: str) -> Spec:
    return {
        "type": "scatter", "x": x, "y": y, "fill": "toself", "mode": "none", "line": {"width": 0}, "hoverinfo": "skip",
        "meta": role, "yaxis": "y2",
    }  # fmt: skip


def plot_misfit(views: Sequence[DropView]) -> Spec:
    """Measured minus simulated depth at the stop, in percent, against impact speed; a symbol a projectile."""
    kinds = list(dict.fromkeys(map(say_projectile, views)))
    data = []
    for k, kind in enumerate(kinds):
        chosen = [view for view in views if say_projectile(view) == kind]
        symbol = SYMBOLS[k % len(SYMBOLS)]
        for role, name in zip(ROLES, views[0].simulated, strict=False):
            deepest = np.array([view.at_stop(name) for view in chosen])
            left = 100 * (np.array([view.at_stop() for view in chosen]) / deepest - 1)
            bars = 200 * np.array([view.allowed_at_stop for view in chosen]) / deepest
            data.append(
                {
                    "type": "scatter", "mode": "markers", "meta": role, "x": [view.speed for view in chosen], "y": left,
                    "error_y": {"array": bars, "thickness": 1, "width": 3},
                    "marker": {"symbol": symbol, "size": 8},
                    "name": html.escape(f"{kind}, {name}"), "text": [html.escape(view.name) for view in chosen],
                    "hovertemplate": "%{text}: %{y:+.2f} % at %{x:.3f} m/s",
                }
            )  # fmt: skip
    layout = {
        "height": 360,
        "margin": MARGIN,
        "hovermode": "closest",
        "showlegend": False,
        "xaxis": {"title": {"text": "impact speed (m/s)"}, "rangemode": "tozero"},
        "yaxis": {"title": {"text": "measured − simulated depth (%)"}, "zeroline": True},
    }
    return {"data": data, "layout": layout}


def plot_p_m(posteriors: Sequence[tuple[str, Posterior]]) -> Spec:
    """Posterior densities of p_m, kPa."""
    data = []
    for role, (name, posterior) in zip(ROLES, posteriors, strict=False):
        middle, density = smooth_density(posterior.calibrated / 1e3)
        data.append(
            {
                "type": "scatter", "mode": "lines", "x": middle, "y": density / density.max(), "fill": "tozeroy",
                "meta": role, "name": html.escape(name), "line": {"width": 2}, "hovertemplate": "%{x:.3f} kPa",
            }
        )  # fmt: skip
    layout = {
        "height": 260,
        "margin": MARGIN | {"t": 10},
        "showlegend": False,
        "xaxis": {"title": {"text": "p_m (kPa)"}},
        "yaxis": {"title": {"text": "density (peak = 1)"}, "rangemode": "tozero"},
    }
    return {"data": data, "layout": layout}


def smooth_density(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Histogram of 60 bins between the 0.1 and 99.9 % quantiles, smoothed over three."""
    low, high = np.quantile(values, [0.001, 0.999])
    if high <= low:
        low, high = low * 0.999 - 1e-9, high * 1.001 + 1e-9
    density, edges = np.histogram(values, bins=60, range=(float(low), float(high)), density=True)
    return 0.5 * (edges[1:] + edges[:-1]), np.convolve(density, [0.25, 0.5, 0.25], mode="same")


def plot_held_out(
    names: Sequence[str], sizes: Sequence[tuple[str, FloatArray]], expected: FloatArray
) -> Spec:
    """Rms (µm) of each drop that no fit had seen, and what a true model would leave."""
    labels = [html.escape(name) for name in names]
    data: list[Spec] = [
        {
            "type": "bar", "x": labels, "y": rms * 1e6, "meta": role, "name": html.escape(name),
            "hovertemplate": "%{y:.2f} µm",
        }
        for role, (name, rms) in zip(ROLES, sizes, strict=False)
    ]  # fmt: skip
    data.append(
        {
            "type": "scatter", "mode": "markers", "x": labels, "y": expected * 1e6, "meta": "measured",
            "marker": {"symbol": "line-ew-open", "size": 12, "line": {"width": 2}}, "name": "expected of a true model",
            "hovertemplate": "%{y:.2f} µm",
        }
    )  # fmt: skip
    layout = {
        "height": 330,
        "margin": MARGIN,
        "barmode": "group",
        "hovermode": "x unified",
        "showlegend": False,
        "xaxis": {"type": "category"},
        "yaxis": {"title": {"text": "rms of the held-out drop (µm)"}, "rangemode": "tozero"},
    }
    return {"data": data, "layout": layout}


def plot_map(view: MapView, values: FloatArray, *, difference: bool = False) -> Spec:
    """A map of φ(r, z), (nz, nr), or of a difference of two, on both sides of the axis, with the bead's outline."""
    limits = DIFFERENCE if difference else PHI
    found = view.map
    r = np.concatenate([-found.r[::-1], found.r]) * 1e3
    values = np.concatenate([values[:, ::-1], values], axis=1)  # both sides of the axis, as one knows it
    centre, radius = (found.bead_radius - found.tip_depth) * 1e3, found.bead_radius * 1e3
    heat = {
        "type": "heatmap", "x": r, "y": found.z * 1e3, "z": values, "zmin": limits["vmin"],
        "zmax": limits["vmax"], "colorscale": "RdBu" if difference else "Viridis",
        "colorbar": {
            "thickness": 10, "len": 0.9, "tickformat": "+.2f" if difference else ".2f",
            "ticksuffix": "" if difference else "\u2007",  # as wide as those of a difference: maps side by side are alike
        },
        "hovertemplate": "r %{x:.3f} mm, z %{y:.3f} mm: %{z:.4f}<extra></extra>",
    }  # fmt: skip
    layout: Spec = {
        "height": 300,
        "margin": MARGIN | {"r": 4, "t": 10},
        "xaxis": {
            "title": {"text": "r (mm)"}, "constrain": "domain", "constraintoward": "right", "showgrid": False,
            "zeroline": False,
        },
        "yaxis": {"title": {"text": "z (mm)"}, "scaleanchor": "x", "constrain": "domain", "showgrid": False},
        "shapes": [
            {
                "type": "circle", "x0": -radius, "x1": radius, "y0": centre - radius, "y1": centre + radius,
                "line": {"width": 1.2},
            }
        ],
    }  # fmt: skip
    layout["xaxis"]["range"] = [float(r[0]), float(r[-1])]
    layout["yaxis"]["range"] = [float(found.z.min() * 1e3), float(found.z.max() * 1e3)]
    return {"data": [heat], "layout": layout}


def plot_undisturbed(
    scans: Sequence[tuple[str, FloatArray, FloatArray, FloatArray]], stated: tuple[float, float]
) -> Spec:
    """φ of dust that no bead reached, against depth, per scan (name, depth m, φ, sigma), and what is stated of the sample."""
    deepest = max(float(depth.max()) for _, depth, _, _ in scans) * 1e3
    value, sigma = stated
    data: list[Spec] = [
        {
            "type": "scatter", "x": [0, deepest, deepest, 0], "y": [value + 2 * sigma] * 2 + [value - 2 * sigma] * 2,
            "fill": "toself", "mode": "none", "hoverinfo": "skip", "meta": "band", "name": "stated ± 2σ", "line": {"width": 0},
        }
    ]  # fmt: skip
    for k, (name, depth, phi, error) in enumerate(scans):
        data.append(
            {
                "type": "scatter", "mode": "markers", "x": depth * 1e3, "y": phi, "meta": "measured",
                "error_y": {"array": error, "thickness": 0.8, "width": 0},
                "marker": {"symbol": SYMBOLS[k % len(SYMBOLS)] + ("-open" if k % 2 else ""), "size": 6},
                "name": html.escape(name), "hovertemplate": "φ %{y:.4f} at %{x:.2f} mm",
            }
        )  # fmt: skip
    layout = {
        "height": 300,
        "margin": MARGIN,
        "legend": {"orientation": "h", "y": 1.14},
        "xaxis": {"title": {"text": "depth (mm)"}, "rangemode": "tozero"},
        "yaxis": {"title": {"text": "filling factor"}},
    }
    return {"data": data, "layout": layout}
