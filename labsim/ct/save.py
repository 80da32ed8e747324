"""What a reduced scan leaves on disk: map.nc, compressed_volume.csv and the summary for scan.json."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from ..records import CompressedVolume, FillingMap
from .compressed import balance_mass
from .reduce import ReducedScan


def summarise_scan(reduced: ReducedScan, compressed: CompressedVolume) -> dict[str, Any]:
    """scan.json of one reduced scan: the keys that stay, and everything else worth keeping."""
    scan_map, surface, bead, grey = reduced.map, reduced.surface, reduced.bead, reduced.grey
    at = int(np.argmin(np.abs(compressed.filling_factor - 0.2)))
    ledger = balance_mass(scan_map, reduced.undisturbed.value)
    sphere = compressed.sphere_volume
    solid = reduced.scan.calibration.density_solid
    voxel = reduced.scan.voxel
    return {
        "format": 1,
        "scan": reduced.scan.name,
        "axis_px": list(scan_map.axis_px),
        "tip_depth_m": scan_map.tip_depth,
        "filling_factor_undisturbed": reduced.undisturbed.value,
        "filling_factor_undisturbed_sigma": reduced.undisturbed.sigma,
        "compacted_volume_m3": float(compressed.volume[at]),
        "compacted_volume_sigma_m3": float(compressed.sigma[at]),
        "compacted_volume_sphere_volumes": float(compressed.volume[at] / sphere),
        "compacted_above": 0.2,
        "normalisation": {"sphere_volume_m3": sphere, "roi_volume_m3": roi_volume(scan_map)},
        "bead": {
            "centre_px": list(bead.centre), "radius_px": bead.radius, "stated_radius_px": bead.stated_radius,
            "rms_px": bead.rms, "saturated": bead.saturated,
        },
        "surface": {"row_px": surface.row, "row_sigma_px": surface.row_sigma, "tilt_rad": surface.tilt,
                    "width_px": surface.width},
        "tilt_rad": list(reduced.tilt), "tilt_sigma_rad": reduced.tilt_sigma, "tilt_followed": reduced.tilt_followed,
        "blur_m": reduced.blur, "surface_width_m": surface.width * voxel,
        "voxel_noise": reduced.voxel_noise,
        "noise_correlation": {"r": reduced.errors.correlation_r, "z": reduced.errors.correlation_z},
        "calibration": {
            "method": "explicit", "grey_air_stated": grey.grey_air_stated, "grey_air_measured": grey.grey_air,
            "filling_factor_of_air": grey.filling_factor_air, "scale_from_air_and_sample": grey.scale_air_dust,
            "dust_mass_in_map_kg": dust_mass(scan_map, solid), "clipped": grey.clipped, "saturated": grey.saturated,
        },
        "cupping_grey": reduced.cupping.amount, "cupping_grey_sigma": reduced.cupping.sigma,
        "cupping_removed": reduced.cupping.followed, "cupping_left_over_grey": reduced.cupping.left_over,
        "rings_rms_grey": reduced.ring_rms,
        "mass_ledger_m3": {"displaced": ledger.displaced, "compacted": ledger.compacted, "heaped": ledger.heaped,
                           "sigma": ledger.sigma},
        "guard_voxels": reduced.facts.get("guard"), "cell_voxels": reduced.facts.get("cell"),
        "warnings": list(scan_map.warnings),
    }  # fmt: skip


def roi_volume(scan_map: FillingMap) -> float:
    """m^3 of the cells below the surface that hold dust: what V_roi normalises with."""
    from .compressed import cell_volumes

    return float(
        cell_volumes(scan_map)[np.isfinite(scan_map.filling_factor) & (scan_map.z < 0)[:, None]].sum()
    )


def dust_mass(scan_map: FillingMap, density_solid: float) -> float:
    """kg of dust in the cells of the map, the bead and its guard left out."""
    from .compressed import cell_volumes

    return float(np.nansum(scan_map.filling_factor * cell_volumes(scan_map)) * density_solid)


def make_dataset(reduced: ReducedScan) -> xr.Dataset:
    """phi, phi_sigma, count, asymmetry over (z, r) in m; what map.nc holds."""
    scan_map = reduced.map
    attributes = {
        "tip_depth_m": scan_map.tip_depth, "bead_radius_m": scan_map.bead_radius, "axis_px": list(scan_map.axis_px),
        "undisturbed": reduced.undisturbed.value, "blur_m": reduced.blur, "voxel_m": reduced.scan.voxel,
        "noise_correlation_r": reduced.errors.correlation_r, "noise_correlation_z": reduced.errors.correlation_z,
        "facts": json.dumps(reduced.facts, default=str), "warnings": "; ".join(scan_map.warnings),
    }  # fmt: skip
    names = {"phi": scan_map.filling_factor, "phi_sigma": scan_map.sigma, "count": scan_map.count,
             "asymmetry": reduced.errors.asymmetry}  # fmt: skip
    return xr.Dataset(
        {name: (("z", "r"), np.asarray(values, float)) for name, values in names.items()},
        coords={"r": ("r", scan_map.r, {"units": "m"}), "z": ("z", scan_map.z, {"units": "m"})},
        attrs=attributes,
    )


def write_map(reduced: ReducedScan, path: Path) -> Path:
    """map.nc: ``make_dataset``, opens with xarray and every netCDF-4 reader."""
    make_dataset(reduced).to_netcdf(path, engine="h5netcdf")
    return path


def write_compressed(compressed: CompressedVolume, path: Path) -> Path:
    """compressed_volume.csv: phi, volume_m3, sigma."""
    table = {"phi": compressed.filling_factor, "volume_m3": compressed.volume, "sigma": compressed.sigma}
    pd.DataFrame(table).to_csv(path, index=False, float_format="%.9g")
    return path
