"""A CT scan on the page: slices with the axis and the bead, the map, and the keys of scan.toml that a look can correct."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from .. import video
from ..campaign_scans import read_sample_alone, read_scan
from ..ct import ReducedScan, compress, open_stack, reduce_scan, summarise_scan
from ..errors import CampaignError
from ..records import Scan
from .record import RecordView, say, take_finite

SHOWN = (
    3.0  # times the grey level of the lowest slice's dust, shown as white: the bead is brighter than all dust
)
PATCH = 4  # px to each side, over which a grey level is averaged


class ScanView(RecordView):
    KIND = "scan"
    KEYS = frozenset({"calibration.grey_air", "calibration.grey_per_density", "scan.axis_px"})

    def __init__(self, path: Path) -> None:
        file = path / "scan.toml" if path.is_dir() else path
        super().__init__(file.resolve().parent.name, file)
        scan = self._read()
        self.stack = open_stack(scan.slices)
        self.stack.flipped = scan.first_slice == "bottom"
        self._top = SHOWN * max(float(np.median(self.stack.slice(self.stack.count - 1))), 1.0)
        campaign = file.resolve().parents[2]
        known = (campaign / "campaign.toml").is_file()
        self._sample = read_sample_alone(campaign).filling_factor if known else None

    def describe(self) -> dict[str, Any]:
        scan = self._read()
        grey = scan.calibration
        return {
            "shape": list(self.stack.shape),
            "numbers": list(range(self.stack.count)),
            "fields": [
                {"key": "calibration.grey_air", "label": "grey of air", "digits": 3, "value": grey.grey_air},
                {
                    "key": "calibration.grey_per_density",
                    "label": "grey per kg/m³",
                    "digits": 6,
                    "value": grey.grey_per_density,
                },
            ],
            "axis": scan.axis,
            "grey_solid": grey.grey_air + grey.grey_per_density * grey.density_solid,
            "density_solid": grey.density_solid,
        }

    def draw(self, number: int) -> bytes:
        return video.encode_picture(self._slice(number), self._top)

    def close(self) -> None:
        """Nothing is held."""

    def read_grey(self, number: int, column: float, row: float) -> dict[str, float]:
        """Mean grey level about a place in a slice, its standard deviation, and the filling factor that it stands for."""
        image = self._slice(number)
        height, width = image.shape
        if not (0 <= column < width and 0 <= row < height):
            raise IndexError(number)
        x, y = round(column), round(row)
        patch = image[max(y - PATCH, 0) : y + PATCH + 1, max(x - PATCH, 0) : x + PATCH + 1].astype(float)
        grey = self._read().calibration
        level = float(patch.mean())
        return {
            "grey": round(level, 3),
            "scatter": round(float(patch.std()), 3),
            "filling_factor": round(
                (level - grey.grey_air) / (grey.grey_per_density * grey.density_solid), 4
            ),
        }

    def _slice(self, number: int) -> np.ndarray:
        if not 0 <= number < self.stack.count:
            raise IndexError(number)
        return self.stack.slice(number)

    def _read(self) -> Scan:
        assert self.edits.file is not None
        found = read_scan(self.edits.file, given=self.edits.as_given(), speed_required=False)
        if not isinstance(found, Scan):
            raise CampaignError(
                self.edits.file,
                "scan.slices",
                "gives published figures, not slices; there is nothing to show",
            )
        return found

    def _measure(self) -> dict[str, Any]:
        reduced = reduce_scan(self._read(), sample_filling_factor=self._sample, progress=self.tell)
        return show_map(reduced)


def show_map(reduced: ReducedScan) -> dict[str, Any]:
    """A reduced scan for the page: places in the slices in px, the map over r and z in mm."""
    found, bead = reduced.map, reduced.bead
    summary = summarise_scan(reduced, compress(found))
    sphere = summary["normalisation"]["sphere_volume_m3"]
    volume, volume_sigma = summary["compacted_volume_m3"], summary["compacted_volume_sigma_m3"]
    lean = np.tan(reduced.tilt) if reduced.tilt_followed else np.zeros(2)
    x, y = found.axis_px
    return {
        "axis": [round(x, 3), round(y, 3)],
        "lean": take_finite(lean, 6),
        "bead": {"centre": take_finite(np.array(bead.centre), 3), "radius": round(bead.radius, 3)},
        "surface": [reduced.surface.row, reduced.surface.row_sigma],
        "voxel_mm": 1e3 * reduced.scan.voxel,
        "map": {
            "r": take_finite(1e3 * found.r, 5),
            "z": take_finite(1e3 * found.z, 5),
            "filling_factor": take_finite(found.filling_factor, 4),
            "sigma": take_finite(found.sigma, 4),
            "bead_z": round(1e3 * reduced.bead_centre_z, 5),
            "bead_radius": round(1e3 * found.bead_radius, 5),
        },
        "lines": [
            ("axis", f"column {x:.2f}, row {y:.2f}"),
            ("tip depth", f"{1e3 * found.tip_depth:.3f} mm"),
            ("undisturbed", say(reduced.undisturbed.value, reduced.undisturbed.sigma, 1.0, "", 4).strip()),
            ("denser than 0.20", say(volume / sphere, volume_sigma / sphere, 1.0, "sphere volumes", 2)),
            ("grey of air as measured", f"{reduced.grey.grey_air:.2f}"),
            ("surface", say(reduced.surface.row, reduced.surface.row_sigma, 1.0, "slices", 2)),
        ],
        "warnings": list(found.warnings),
    }
