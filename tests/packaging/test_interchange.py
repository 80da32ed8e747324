"""What labsim writes opens in the programs it is written for: posteriors in ArviZ, runs in h5py and pandas."""

from __future__ import annotations

import warnings
from pathlib import Path

import h5py
import numpy as np
import pytest

import labsim
from labsim.inference.fits.posterior import sample
from labsim.runs.run_file import write_run_file


def test_a_posterior_opens_with_arviz(tmp_path: Path) -> None:
    """Written as the commands write it; a normal posterior of ln p_m about 1300 Pa with a width of 2 %."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)
        import arviz
    found = sample(
        lambda theta: -0.5 * ((theta[:, 0] - np.log(1300.0)) / 0.02) ** 2 - 0.5 * (theta[:, 1] / 0.3) ** 2,
        ["p_m_Pa", "pixel_scale.factor"],
        np.array([np.log(1300.0), 0.0]),
        np.diag([0.02**2, 0.3**2]),
        seed=1,
        transform=lambda name, values: np.exp(values) if name == "p_m_Pa" else 1.0 + values,
    )
    found.data.to_netcdf(str(tmp_path / "posterior.nc"), engine="h5netcdf")
    read = arviz.from_netcdf(str(tmp_path / "posterior.nc"))
    assert read.posterior["p_m_Pa"].dims == ("chain", "draw")
    assert np.array_equal(read.posterior["p_m_Pa"], found.data.posterior["p_m_Pa"])
    assert "lp" in read.sample_stats
    table = arviz.summary(read, kind="stats", round_to="none")
    assert table.loc["p_m_Pa", "mean"] == pytest.approx(1300.0, abs=4.0)
    assert table.loc["p_m_Pa", "sd"] == pytest.approx(26.0, rel=0.1)
    assert table.loc["pixel_scale.factor", "mean"] == pytest.approx(1.0, abs=0.05)


def test_a_run_opens_with_h5py(tmp_path: Path) -> None:
    setting = labsim.DropSetting(
        labsim.Projectile("hemisphere", 5e-4, 1.33e-6), 0.4, labsim.Material(p_m=4000.0), spacing=1.25e-4
    )
    run = labsim.simulate(setting, store=tmp_path / "store", workers=1)
    path = write_run_file(tmp_path / "run.h5", run)
    found: dict[str, np.ndarray] = {}
    with h5py.File(path) as file:
        file.visititems(
            lambda name, item: found.update({name: item[()]}) if isinstance(item, h5py.Dataset) else None
        )
    depth = [
        values
        for name, values in found.items()
        if name.rsplit("/", 1)[-1] == "depth" and np.ndim(values) == 1
    ]
    assert any(np.array_equal(values, labsim.tabulate(run)["depth_m"]) for values in depth)
