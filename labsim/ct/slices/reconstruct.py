"""Projections to slices: flat field, linearised attenuation, centre of rotation, filtered back projection.

Parallel beam with scikit-image; cone beam (FDK) through ASTRA where that optional package is installed.
"""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
from scipy.ndimage import shift
from scipy.optimize import minimize_scalar
from skimage.transform import iradon

from ...errors import MeasurementError
from ...records import FloatArray


def read_projections(path: Path) -> tuple[FloatArray, FloatArray]:
    """-ln transmission (angles, rows, columns) and the angles (rad) of a DXchange file. Raises MeasurementError."""
    with h5py.File(path, "r") as file:
        for name in ("exchange/data", "exchange/data_white", "exchange/data_dark"):
            if name not in file:
                raise MeasurementError(
                    path, name, "is missing; projections need images, flat fields and dark fields"
                )
        data, white, dark = (
            np.asarray(file[f"exchange/{n}"], float) for n in ("data", "data_white", "data_dark")
        )
        angles = (
            np.asarray(file["exchange/theta"], float)
            if "exchange/theta" in file
            else np.linspace(0, 180, len(data), False)
        )
    if np.ptp(angles) > 2 * np.pi + 0.1:
        angles = np.deg2rad(angles)
    return absorb(data, white.mean(0), dark.mean(0)), angles


def absorb(data: FloatArray, white: FloatArray, dark: FloatArray) -> FloatArray:
    """-ln((data - dark) / (white - dark)), at least 1e-4 of the beam left."""
    return -np.log(np.clip((data - dark) / np.maximum(white - dark, 1e-9), 1e-4, None))


def linearise(
    attenuation: FloatArray, wedge: FloatArray, thickness: FloatArray, degree: int = 5
) -> FloatArray:
    """Beam hardening taken out: the thickness of dust's solid that gives each -ln transmission.

    wedge, thickness : (n,), -ln transmission measured or computed for known thicknesses; a polynomial without constant
    term of this degree goes through them. The result has thickness's unit.
    """
    powers = np.arange(1, degree + 1)
    coefficients = np.linalg.lstsq(wedge[:, None] ** powers, thickness, rcond=None)[0]
    result = np.zeros_like(np.asarray(attenuation, float))
    for c in coefficients[::-1]:
        result = (result + c) * attenuation
    return result


def find_centre(first: FloatArray, opposite: FloatArray, reach: float = 0.2) -> float:
    """Column of the rotation axis from two projections half a turn apart, (rows, columns) each.

    The opposite one mirrored about the axis is the first one; their least squares difference is minimised with
    sub-pixel shifts. reach : share of the width in which the axis is looked for about the middle.
    """
    first, opposite = np.atleast_2d(first), np.atleast_2d(opposite)[:, ::-1]
    n = first.shape[1]

    def misfit(centre: float) -> float:
        # mirrored columns j -> n - 1 - j; about centre c they must move by 2 c - (n - 1)
        moved = shift(opposite, (0, 2 * centre - (n - 1)), order=1, cval=np.nan)
        overlap = np.isfinite(moved)
        return float(np.mean((moved[overlap] - first[overlap]) ** 2))

    grid = np.arange((n - 1) / 2 - reach * n / 2, (n - 1) / 2 + reach * n / 2 + 0.25, 0.5)
    values = [misfit(c) for c in grid]
    best = float(grid[int(np.argmin(values))])
    return float(minimize_scalar(misfit, bounds=(best - 0.75, best + 0.75), method="bounded").x)


def find_centre_of_mass(attenuation: FloatArray, angles: FloatArray) -> float:
    """Column of the rotation axis from the sinogram's centre of mass, a check: it is axis + a cos + b sin of the angle."""
    weight = np.clip(attenuation.reshape(len(angles), -1, attenuation.shape[-1]).sum(1), 0, None)
    centre = (weight * np.arange(weight.shape[1])).sum(1) / weight.sum(1)
    design = np.column_stack([np.ones_like(angles), np.cos(angles), np.sin(angles)])
    return float(np.linalg.lstsq(design, centre, rcond=None)[0][0])


def find_symmetry_axis(image: FloatArray) -> float:
    """Column about which an image is its own mirror image."""
    return find_centre(image, image)


def reconstruct_parallel(
    sinogram: FloatArray, angles: FloatArray, centre: float, pixel: float = 1.0
) -> FloatArray:
    """One slice (columns, columns) by filtered back projection; attenuation per unit of ``pixel``.

    sinogram : (angles, columns); angles in rad; centre : column of the axis. scikit-image turns about column n // 2.
    """
    n = sinogram.shape[1]
    centred = shift(np.asarray(sinogram, float), (0, n // 2 - centre), order=1, mode="nearest")
    return iradon(centred.T, theta=np.rad2deg(angles), filter_name="ramp", circle=True) / pixel


def reconstruct_cone(
    attenuation: FloatArray, angles: FloatArray, pixel: float, source_to_axis: float, axis_to_camera: float
) -> FloatArray:
    """Volume (slices, rows, columns) from cone-beam projections (angles, rows, columns) by FDK; lengths in m.

    Needs the optional package ASTRA; raises MeasurementError where it is not installed.
    """
    try:
        import astra
    except ImportError:
        raise MeasurementError(
            "reconstruct_cone", "astra", "is not installed; run: pip install astra-toolbox, or export slices"
        ) from None
    _, rows, columns = attenuation.shape
    magnified = (source_to_axis + axis_to_camera) / source_to_axis
    voxel = pixel / magnified
    scale = 1 / voxel  # ASTRA's volume has unit voxels
    projections = astra.create_proj_geom(
        "cone",
        pixel * scale,
        pixel * scale,
        rows,
        columns,
        angles,
        source_to_axis * scale,
        axis_to_camera * scale,
    )
    volume = astra.create_vol_geom(columns, columns, rows)
    data = astra.data3d.create("-sino", projections, attenuation.transpose(1, 0, 2).astype(np.float32))
    result = astra.data3d.create("-vol", volume)
    settings = astra.astra_dict("FDK_CUDA")
    settings["ProjectionDataId"], settings["ReconstructionDataId"] = data, result
    algorithm = astra.algorithm.create(settings)
    try:
        astra.algorithm.run(algorithm)
        return astra.data3d.get(result) * scale
    finally:
        astra.algorithm.delete(algorithm)
        astra.data3d.delete([data, result])
