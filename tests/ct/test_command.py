"""``labsim ct`` on a labelled scan: the files of the contract, readable, and bad input as one line."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from labsim.cli import main

SCAN = Path(__file__).parents[2] / "data" / "ct" / "labelled_scans" / "p01-C01"


def test_files_and_keys(tmp_path, capsys):
    with pytest.raises(SystemExit) as left:
        main(["ct", str(SCAN), "-o", str(tmp_path / "out"), "--json", "--quiet"])
    assert left.value.code == 0
    printed = json.loads(capsys.readouterr().out)
    summary = json.loads((tmp_path / "out" / "scan.json").read_text())
    for key in (
        "axis_px",
        "tip_depth_m",
        "filling_factor_undisturbed",
        "compacted_volume_m3",
        "compacted_volume_sphere_volumes",
        "warnings",
    ):
        assert summary[key] == printed[key]
    with xr.open_dataset(tmp_path / "out" / "map.nc") as found:
        assert found.phi.dims == ("z", "r") and {"phi", "phi_sigma", "count"} <= set(found.data_vars)
        assert float(found.phi.sel(r=1.0e-3, z=-2.5e-3, method="nearest")) == pytest.approx(0.15, abs=0.003)
    curve = pd.read_csv(tmp_path / "out" / "compressed_volume.csv")
    assert list(curve) == ["phi", "volume_m3", "sigma"]
    assert (np.diff(curve.volume_m3) <= 0).all()
    for name in ("map.png", "compressed_volume.png"):
        assert (tmp_path / "out" / name).stat().st_size > 10_000


def test_bad_input_is_one_line(tmp_path, capsys):
    with pytest.raises(SystemExit) as left:
        main(["ct", str(tmp_path / "nothing")])
    assert left.value.code == 2
    text = capsys.readouterr().err
    assert text.startswith("error: ") and text.count("\n") == 1
