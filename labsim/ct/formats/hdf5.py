"""HDF5 in the DXchange layout: slices of a reconstructed volume in /exchange/data, axes (z, y, x)."""

from __future__ import annotations

from pathlib import Path

import h5py

from ...errors import MeasurementError
from ..slices.stack import SliceStack

SUFFIXES = (".h5", ".hdf5", ".hdf", ".nx", ".nxs")


def recognises(path: Path) -> bool:
    return path.is_file() and path.suffix.lower() in SUFFIXES


# what h5py says of a file whose inner tables are damaged
DAMAGED = (OSError, KeyError, RuntimeError, TypeError, ValueError)


def open_stack(path: Path) -> SliceStack:
    """Open the volume of a DXchange file; raises MeasurementError where it holds projections or nothing, or is damaged."""
    try:
        return _open_volume(path, h5py.File(path, "r"))
    except DAMAGED as trouble:
        raise MeasurementError(path, "scan.slices", f"is not a readable HDF5 file ({trouble})") from None


def _open_volume(path: Path, file: h5py.File) -> SliceStack:
    if "exchange/data" not in file:
        raise MeasurementError(path, "exchange/data", "is missing; DXchange keeps the volume there")
    data = file["exchange/data"]
    if not isinstance(data, h5py.Dataset) or data.dtype.kind not in "uif":
        raise MeasurementError(path, "exchange/data", "holds no numbers; DXchange keeps the volume there")
    if "exchange/theta" in file or "exchange/data_white" in file:
        raise MeasurementError(
            path,
            "exchange/data",
            "holds projections, not slices; labsim.ct.slices.reconstruct makes slices of them",
        )
    if data.ndim != 3 or data.shape[0] < 8:
        raise MeasurementError(
            path, "exchange/data", f"has shape {data.shape}; (slices >= 8, rows, columns) is needed"
        )
    voxel = data.attrs.get("voxel_m")
    return SliceStack(
        path, data.shape[0], data.shape[1:], data.dtype, lambda k: data[k],
        None if voxel is None else float(voxel), {"format": "hdf5"}, packed=path.stat().st_size,
    )  # fmt: skip
