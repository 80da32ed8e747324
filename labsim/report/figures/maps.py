"""The pictures of a CT scan: the filling factor with the bead in place, its error, and the compacted volume."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from ...records import CompressedVolume, FillingMap, FloatArray
from .style import PHI, new_figure


def draw_map(scan_map: FillingMap, undisturbed: float, path: Path, title: str = "") -> Path:
    """map.png: filling factor mirrored about the axis, with the bead; beside it the standard error of every cell."""
    with new_figure(path, 12.5, 6.2) as figure:
        axes = figure.subplots(1, 2)
        image = _show(axes[0], scan_map, scan_map.filling_factor, PHI)
        r, z, phi = _mirror(scan_map, scan_map.filling_factor)
        lines = axes[0].contour(r, z, phi, [0.16, 0.20, 0.25], colors="k", linewidths=[0.5, 1.4, 1.0])
        axes[0].clabel(lines, fmt="%.2f", fontsize=8)
        figure.colorbar(image, ax=axes[0], label="filling factor", extend="both")
        axes[0].set_title(
            f"{title}  undisturbed {undisturbed:.4f}, tip {scan_map.tip_depth * 1e3:.3f} mm deep".strip()
        )
        top = np.nanpercentile(scan_map.sigma, 99)
        image = _show(axes[1], scan_map, scan_map.sigma, {"cmap": "magma", "vmin": 0.0, "vmax": top})
        figure.colorbar(image, ax=axes[1], label="standard error of a cell")
        axes[1].set_title("error (the calibration's scale not included)")
    return path


def draw_compressed(curve: CompressedVolume, path: Path, title: str = "") -> Path:
    """compressed_volume.png: volume denser than a filling factor, in sphere volumes, with its one-sigma band."""
    with new_figure(path, 6.6, 4.6) as figure:
        axis = figure.subplots()
        volume, sigma = curve.volume / curve.sphere_volume, curve.sigma / curve.sphere_volume
        axis.fill_between(
            curve.filling_factor, np.maximum(volume - sigma, 1e-5), volume + sigma, alpha=0.3, lw=0
        )
        axis.plot(curve.filling_factor, np.where(volume > 0, volume, np.nan))
        axis.axvline(0.2, color="0.5", lw=0.8, ls="--")
        axis.set(yscale="log", ylim=(1e-3, max(3.0, 2 * float(np.max(volume[curve.filling_factor > 0.155])))))
        axis.set(
            xlim=(0.14, 0.35),
            xlabel="filling factor φ",
            ylabel="volume denser than φ / sphere volume",
            title=title,
        )
        axis.text(
            0.201, axis.get_ylim()[1] * 0.85, " counted as compacted", fontsize=8, color="0.4", va="top"
        )
        axis.grid(alpha=0.3)
    return path


def _mirror(scan_map: FillingMap, values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    r = np.concatenate([-scan_map.r[::-1], scan_map.r]) * 1e3
    return r, scan_map.z * 1e3, np.concatenate([values[:, ::-1], values], axis=1)


def _show(axis: Axes, scan_map: FillingMap, values: FloatArray, colours: dict[str, Any]):
    r, z, mirrored = _mirror(scan_map, values)
    image = axis.pcolormesh(r, z, mirrored, shading="nearest", **colours)
    radius, centre = scan_map.bead_radius * 1e3, (scan_map.bead_radius - scan_map.tip_depth) * 1e3
    axis.add_patch(Circle((0, centre), radius, facecolor="#9b1b1b", edgecolor="k", lw=1.0, zorder=3))
    axis.text(0, centre, "bead", color="w", ha="center", va="center", zorder=4)
    axis.axhline(0, color="0.85", lw=0.8, ls="--", zorder=2)
    axis.set_facecolor("0.82")
    axis.set(
        aspect="equal",
        xlabel="distance from the axis (mm)",
        ylabel="height above the undisturbed surface (mm)",
    )
    return image
