"""Campaigns at the edge of what can be diagnosed, with runs that obey a closed-form law."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import dynesty
import laws
import numpy as np
import pytest

from labsim.campaign import read_campaign
from labsim.diagnosis.campaign import diagnose_campaign
from labsim.effects.model import Model
from labsim.errors import EffectError
from labsim.inference.calibrate import calibrate
from labsim.inference.fits.target import make_target
from labsim.report.outputs import write_result


def test_a_single_drop_is_diagnosed_without_holding_any_out(place):
    campaign = read_campaign(laws.write_campaign(place / "campaign-single", drops=laws.DROPS[2:3]))
    found = diagnose_campaign(campaign, laws.LawStore(place / "store"), workers=1)
    folder = place / "single"
    folder.mkdir()
    summary, lines = write_result(found, folder)
    assert math.isnan(found.gain.rms_nominal)
    assert json.loads((folder / "diagnosis.json").read_text())["gain"]["rms_nominal_m"] is None
    assert summary["verdict"] in ("none", "effect", "unknown")
    assert "nan" not in lines.splitlines()[0]


def test_a_drop_that_shows_nothing_is_left_out_and_said(place):
    folder = laws.write_campaign(place / "campaign-empty-drop")
    track = folder / "drops" / "D02" / "track.csv"
    head, *rows = track.read_text().splitlines()
    track.write_text("\n".join([head, *rows[-15:]]) + "\n")  # begins below the surface
    found = diagnose_campaign(read_campaign(folder), laws.LawStore(place / "store"), workers=1)
    assert [
        model.observed.name for model in found.problem.tracks.models if model.observed.name == "D02"
    ] == []
    assert any("drop D02 left out" in warning for warning in found.warnings)


RATE = Model(1300.0, (("strength_rate", {"eta": 0.05, "n": 0.5}),))


def test_an_extended_model_is_part_of_the_simulation(place):
    """The gain is there when the model is applied: p_m comes out true, and the data are explained."""
    campaign = read_campaign(laws.write_campaign(place / "campaign-model", rate=0.05))
    # or a scatter of 20 % would explain what the rate does
    campaign = replace(campaign, sample=replace(campaign.sample, scatter=0.02))
    plain = calibrate(campaign, store=laws.LawStore(place / "store"))
    extended = calibrate(campaign, store=laws.LawStore(place / "store"), model=RATE)
    assert extended.fit.log_likelihood > plain.fit.log_likelihood + 20
    assert extended.p_value > 0.01 > plain.p_value
    low, high = np.quantile(extended.posterior.samples("p_m_Pa"), [0.005, 0.995])
    assert low < 1300.0 < high
    assert np.median(plain.posterior.samples("p_m_Pa")) > 1.5 * 1300.0


def test_a_model_that_cannot_be_at_work_here_is_refused(place):
    campaign = read_campaign(laws.write_campaign(place / "campaign-no-scan"))
    model = Model(1300.0, (("ct_scale", {"factor": 1.05}),))
    with pytest.raises(EffectError, match="does not apply here"):
        calibrate(campaign, store=laws.LawStore(place / "store"), model=model)


def integrate_evidence(problem, fit):
    """ln of the integrated likelihood by nested sampling (Speagle 2020, MNRAS 493, 3132), and its error."""
    target = make_target(problem, fit)
    low, high = target.bounds[0]
    cut = [tuple(float(p.prior.cdf(limit)) for limit in p.limits) for p in target.parameters]

    def place_point(cube):
        point = [low + (high - low) * cube[0]]
        for u, parameter, (below, above) in zip(cube[1:], target.parameters, cut, strict=True):
            point.append(float(parameter.prior.ppf(below + (above - below) * u)) - parameter.null)
        return np.array(point)

    sampler = dynesty.NestedSampler(
        lambda theta: -float(target.misfit(theta)[0]),
        place_point,
        len(target.names),
        nlive=400,
        rstate=np.random.default_rng(1),
    )
    sampler.run_nested(dlogz=0.05, print_progress=False)
    points = sum(block.residual.size for block in fit.blocks)
    determinant = sum(float(np.linalg.slogdet(block.covariance)[1]) for block in fit.blocks)
    constant = -0.5 * (determinant + points * math.log(2 * math.pi))
    price = sum(problem.shape_evidence.get(name, 0.0) for name in fit.hypothesis)
    return float(sampler.results.logz[-1]) + constant + price, float(sampler.results.logzerr[-1])


@pytest.mark.parametrize("effect", ["pixel_scale", "strength_rate"])
def test_nested_sampling_agrees_with_the_formula_for_the_evidence(place, effect):
    campaign = read_campaign(laws.write_campaign(place / f"campaign-evidence-{effect}", rate=0.05))
    found = calibrate(campaign, ("p_m", effect), store=laws.LawStore(place / "store"))
    nested, error = integrate_evidence(found.problem, found.fit)
    assert nested == pytest.approx(found.fit.evidence, abs=0.5 + 3 * error)
