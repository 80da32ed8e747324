"""A best p_m that its range does not hold: fit, χ², p value and chain are those of the best inside, and it is said first."""

import json
import math
import re

import laws
import numpy as np
import pytest

from labsim.campaign import read_campaign
from labsim.diagnosis.campaign import diagnose_campaign
from labsim.inference.calibrate import calibrate
from labsim.inference.fits import fitting
from labsim.report.outputs import write_result

TRUE = 1300.0  # Pa, of laws.write_campaign


@pytest.mark.parametrize(
    "p_m_range", [(3000.0, 6000.0), (300.0, 900.0), (300.0, 1320.0), (1280.0, 6000.0), (300.0, 6000.0)]
)
def test_a_range_without_the_truth_is_said_first(tmp_path, p_m_range):
    folder = laws.write_campaign(tmp_path / "campaign")
    set_range(folder, p_m_range)
    found = calibrate(read_campaign(folder), store=laws.LawStore(tmp_path / "store"))
    low, high = p_m_range
    p_m = math.exp(found.fit.log_p_m)
    samples = found.posterior.samples("p_m_Pa")
    assert low * (1 - 1e-9) <= p_m <= high * (1 + 1e-9)
    assert low * (1 - 1e-9) <= samples.min() and samples.max() <= high * (1 + 1e-9)
    if (low, high) == (300.0, 6000.0):  # as wide as the fit and other codes together
        wide = math.hypot(math.sqrt(found.fit.covariance[0, 0]), found.problem.budget.other_codes)
        assert np.std(np.log(samples)) == pytest.approx(wide, rel=0.05)
    apart = min(abs(math.log(p_m / end)) for end in p_m_range) / math.sqrt(found.fit.covariance[0, 0])
    (tmp_path / "out").mkdir()
    _, lines = write_result(found, tmp_path / "out")
    written = json.loads((tmp_path / "out" / "calibration.json").read_text())
    said = written["warnings"]
    if (low, high) == (300.0, 6000.0):  # every sample has a strength of its own about the common one
        assert list(written["samples"]) == [drop.name for drop in found.campaign.drops]
        assert np.log(list(written["samples"].values())) == pytest.approx(math.log(p_m), abs=0.06)
        assert len(set(written["samples"].values())) == len(found.campaign.drops)
    if apart < 2.0:
        assert "end of its range" in said[0] and lines.startswith("warning: the best p_m lies ")
    else:
        assert not any("range" in text for text in said) and "p_m = " in lines.splitlines()[0]
    if not low < TRUE < high:  # the p value is that of the p_m that is printed, not of one outside
        assert apart < 0.1 and found.p_value < 1e-3
        assert "does not explain the data" in said[1] and "does not explain" in lines.splitlines()[1]
        # and χ² that of the end itself
        assert found.fit.chi_square == pytest.approx(at_the_end(found), rel=0.02)
        assert np.median(samples) == pytest.approx(p_m, rel=0.05)


def set_range(folder, p_m_range):
    file = folder / "campaign.toml"
    text, changed = re.subn(r"(?m)^p_m_range_Pa *=.*$", f"p_m_range_Pa = {list(p_m_range)}", file.read_text())
    assert changed == 1
    file.write_text(text)


def at_the_end(found) -> float:
    """χ² where p_m stays at the end nearest to the truth, nuisances at their best."""
    end = min(found.campaign.p_m_range, key=lambda p: abs(math.log(p / TRUE)))
    fit = fitting.fit_hypothesis(found.problem, (), (math.log(end), {}), nuisances=found.fit, iterations=0)
    return fit.chi_square


def test_a_diagnosis_says_it_too(tmp_path):
    folder = laws.write_campaign(tmp_path / "campaign", rate=0.05)
    set_range(folder, (300.0, 1400.0))
    found = diagnose_campaign(read_campaign(folder), laws.LawStore(tmp_path / "store"), workers=1)
    (tmp_path / "out").mkdir()
    summary, lines = write_result(found, tmp_path / "out")
    assert math.exp(found.nominal.log_p_m) == pytest.approx(1400.0)
    assert summary["warnings"][0].startswith(
        "nominal model: the best p_m lies at the end of its range, 1400 Pa"
    )
    assert lines.startswith("warning: nominal model: the best p_m lies at the end of its range")
    assert np.quantile(found.posterior_nominal.samples("p_m_Pa"), 0.999) <= 1400.0
