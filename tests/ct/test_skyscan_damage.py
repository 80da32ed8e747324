"""Damaged SkyScan logs and TIFF descriptions: an error that names the key, or passed over; never a traceback."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import tifffile

from labsim.ct.formats.images import read_rescale
from labsim.ct.slices.skyscan import check_log, read_log
from labsim.errors import MeasurementError

LOG = (
    "[Reconstruction]\nPixel Size (um)={pixel}\nSections Count={count}\n"
    "Result Image Width (pixels)={width}\nBMP LUT={lut}\nBeam Hardening Correction (%)={hardening}\n"
)
SOUND = {"pixel": "37.0", "count": "64", "width": "56", "lut": "0", "hardening": "OFF"}


def check(folder: Path, **changed: str) -> None:
    file = folder / "scan_rec.log"
    file.write_text(LOG.format(**{**SOUND, **changed}))
    log = read_log(file)
    check_log(log, 64, (56, 56), np.dtype("uint16"))
    assert log.voxel == 37.0e-6


def test_a_sound_log_is_taken(tmp_path: Path) -> None:
    check(tmp_path)
    check(tmp_path, count="", lut="1.2.3")


@pytest.mark.parametrize(
    ("key", "name"), [("pixel", "pixel size"), ("count", "sections"), ("width", "width")]
)
@pytest.mark.parametrize("value", ["1e999", "nan", "inf", "many"])
def test_what_is_no_number_is_named(tmp_path: Path, key: str, name: str, value: str) -> None:
    with pytest.raises(MeasurementError, match=f"(?i){name}.*{value}.*not a number"):
        check(tmp_path, **{key: value})


def test_a_count_that_cannot_be_is_said_shortly(tmp_path: Path) -> None:
    with pytest.raises(MeasurementError, match=r"(?i)sections count: is 1e\+308 but there are 64"):
        check(tmp_path, count="1e308")


@pytest.mark.parametrize(
    ("text", "found"),
    [("slope = 2.5e-3 offset = -1", {"slope": 2.5e-3, "offset": -1.0}), ("slope = 1.2.3 offset = .", {})],
)
def test_slope_and_offset_of_a_tiff(tmp_path: Path, text: str, found: dict[str, float]) -> None:
    tifffile.imwrite(tmp_path / "a.tif", np.zeros((4, 4), np.uint8), description=text, metadata=None)
    assert read_rescale(tmp_path / "a.tif") == found
