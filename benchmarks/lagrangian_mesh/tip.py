"""What the dust at the tip holds: the same figures for any solver that gives places, volumes and filling factors."""

from __future__ import annotations

import numpy as np

THRESHOLDS = (0.17, 0.20, 0.22)
LAYERS = ((0.0, 0.3), (0.3, 1.0), (1.0, 2.0))  # distances to the surface, in spacings
NEAR = 2.0  # tip radii from the tip's centre, for the percentile


def measure_tip(
    r: np.ndarray,
    z: np.ndarray,
    volume: np.ndarray,
    phi: np.ndarray,
    depth: float,
    radius: float,
    spacing: float,
) -> dict[str, float]:
    """Figures of the dust around a tip ``depth`` m below z = 0. Arrays (n,): places (m), volumes (m^3), filling factors.

    V(>φ): volume above φ in volumes of a bead of the tip's radius; max and 99.9: φ that all, or 99.9 % of the volume within
    two radii of the tip's centre, stay below; layers: mean and largest φ under the hemisphere by distance to its surface.
    """
    bead = 4 / 3 * np.pi * radius**3
    found = {f"V(>{level:.2f})": float(volume[phi > level].sum() / bead) for level in THRESHOLDS}
    up = z - (radius - depth)
    away = np.hypot(r, up)
    near = away < NEAR * radius
    order = np.argsort(phi[near])
    share = np.cumsum(volume[near][order]) / volume[near].sum()
    found["max"] = float(phi.max())
    found["99.9"] = float(phi[near][order][np.searchsorted(share, 0.999)])
    distance = np.where(up < 0.0, (away - radius) / spacing, np.inf)
    for low, high in LAYERS:
        layer = (distance >= low) & (distance < high)
        name = f"{low:g}-{high:g} dx"
        held = volume[layer].sum()
        found[f"{name} mean"] = float((volume * phi)[layer].sum() / held) if held else np.nan
        found[f"{name} max"] = float(phi[layer].max()) if held else np.nan
    return found


def print_table(columns: dict[str, dict[str, str]]) -> None:
    """Markdown, a column for each entry and a row for each figure."""
    if columns:
        print("| | " + " | ".join(columns) + " |\n|" + " --- |" * (len(columns) + 1))
        for name in next(iter(columns.values())):
            print(f"| {name} | " + " | ".join(column.get(name, "") for column in columns.values()) + " |")
