"""p_m from accelerometers: motions of a law in closed form, whose truth is known."""

from __future__ import annotations

import json
import math
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import accelerations
import laws
import numpy as np
import pytest

from labsim.campaign import read_campaign
from labsim.diagnosis.campaign import diagnose_campaign
from labsim.diagnosis.gain import predict_held_out
from labsim.diagnosis.unlisted.unknown import fit_unknown, law_coordinates
from labsim.effects import Instrument
from labsim.inference.calibrate import calibrate, prepare
from labsim.inference.emulation.curves import extract_speeds, interpolate_speed
from labsim.inference.fits import steps
from labsim.inference.fits.tangents import linearise_at
from labsim.inference.observations.acceleration_model import AccelerationModel
from labsim.inference.scatter import estimate_scatter, set_error_budget
from labsim.records import STANDARD_GRAVITY, Material, Projectile
from labsim.report.outputs import write_result
from labsim.sph import DropSetting, simulate
from labsim.sph.profile import is_blunt
from labsim.sph.tips import make_profile


def fit(folder: Path, tmp_path: Path):  # type: ignore[no-untyped-def]
    found = calibrate(read_campaign(folder), store=laws.LawStore(tmp_path / "store"), workers=1)
    return found, np.quantile(found.posterior.data.posterior["p_m_Pa"], [0.05, 0.95])


@pytest.mark.parametrize(
    ("p_m", "noise", "scale"), [(800.0, 0.005, 1.01), (1300.0, 0.02, 0.99), (2600.0, 0.01, 1.0)]
)
def test_p_m_lies_in_its_interval(tmp_path: Path, p_m: float, noise: float, scale: float) -> None:
    folder = accelerations.write_campaign(tmp_path / "c", p_m=p_m, noise=noise, scale=scale)
    found, (low, high) = fit(folder, tmp_path)
    assert low < p_m < high and high / low < 1.25
    assert found.p_value > 0.05


def test_an_accelerometer_stands_beside_cameras(tmp_path: Path) -> None:
    """Three drops of each: both are compared, the interval holds the truth, a spoilt scale of the sensor shows."""
    felt = accelerations.write_campaign(tmp_path / "felt", scale=1.35)
    seen = laws.write_campaign(tmp_path / "c")
    for name in ("D01", "D03", "D05"):
        shutil.rmtree(seen / "drops" / name)
        shutil.copytree(felt / "drops" / name, seen / "drops" / name)
    spoilt, _ = fit(seen, tmp_path)
    sound_felt = accelerations.write_campaign(tmp_path / "sound")
    for name in ("D01", "D03", "D05"):
        shutil.copy(sound_felt / "drops" / name / "acceleration.csv", seen / "drops" / name)
    sound, (low, high) = fit(seen, tmp_path)
    kinds = [isinstance(model, AccelerationModel) for model in sound.problem.tracks.models]
    assert kinds == [True, False] * 3
    assert low < 1300.0 < high and sound.p_value > 0.05
    # by itself it may be dust that differs by as much, which is what is said
    assert spoilt.problem.budget.scatter > 0.1 and sound.problem.budget.scatter == 0.02
    assert "scatters by" in spoilt.warnings[0] and spoilt.fit.evidence < sound.fit.evidence - 5.0


@pytest.mark.parametrize("seed", [3, 4, 5])
def test_five_samples_in_the_dust_are_enough(seed: int, tmp_path: Path) -> None:
    """A slow sensor: contact lies anywhere in a sample, the stop is known to one, and no drop is left out."""
    drops = [(1.0, 12.0, 0.35), (1.0, 12.0, 0.7), (1.0, 12.0, 0.5)]
    folder = accelerations.write_campaign(tmp_path / "c", rate=2.2e3, noise=0.002, seed=seed, drops=drops)
    found, (low, high) = fit(folder, tmp_path)
    models = found.problem.tracks.models
    assert len(models) == len(drops) and max(np.sum(m.below) for m in models) < 8
    assert low < 1300.0 < high and found.p_value > 0.05


def write_both(folder: Path, *, joined: bool) -> Path:
    """Six drops that a camera and an accelerometer record; ``joined``: the campaign says so, else they are twelve drops."""
    seen = laws.write_campaign(folder)
    text = seen / "campaign.toml"
    text.write_text(text.read_text().replace("[sample]", "[sample]\nscatter = 0.3"))
    felt = accelerations.write_campaign(folder.with_name(f"{folder.name}-felt"))
    for number in range(1, 7):
        at = seen / "drops" / f"A{number:02d}"
        shutil.copytree(felt / "drops" / f"D{number:02d}", at)
        said = (at / "drop.toml").read_text()
        camera = (seen / "drops" / f"D{number:02d}" / "drop.toml").read_text()
        projectile = camera[camera.index("[projectile]") : camera.index("[drop]")]
        place = f'same_as = "D{number:02d}"' if joined else f"sequence = {number + 6}"
        said = projectile + said[said.index("[drop]") :].replace(f"sequence = {number}", place)
        (at / "drop.toml").write_text(said)
    return seen


def test_two_records_of_a_drop_have_its_dust_in_common(tmp_path: Path) -> None:
    """Where samples differ by 30 %, twelve drops say more of p_m than six that two instruments record."""
    widths = []
    for joined in (True, False):
        campaign = read_campaign(write_both(tmp_path / f"{joined}", joined=joined))
        budget = set_error_budget(campaign)
        problem, found = prepare(campaign, laws.LawStore(tmp_path / "store"), workers=1, budget=budget)
        widths.append(math.sqrt(found.covariance[0, 0]))
        held = predict_held_out(problem, found)
        assert len(held.names) == (6 if joined else 12)
        assert estimate_scatter(problem, found).sd > 0.0
    # as 1 over the root of the number of drops, beside what is common to all
    assert widths[0] > 1.3 * widths[1]


def test_errors_of_an_acceleration_integrate_to_depths(tmp_path: Path) -> None:
    """A constant error of 1 m/s² makes -t²/2 of depth at the end of each stretch, counted from contact."""
    folder = accelerations.write_campaign(tmp_path / "c", drops=[(1.0, 12.0, 0.7)])
    problem, _ = prepare(read_campaign(folder), laws.LawStore(tmp_path / "store"), workers=1)
    model = problem.tracks.models[0]
    assert isinstance(model, AccelerationModel)
    begin = model.observed.begin[model.below][0]
    depth = model.lengths @ np.ones(model.data.size)
    expected = -0.5 * (model.observed.end - begin) ** 2
    np.testing.assert_allclose(depth[model.below], expected[model.below], rtol=0.02, atol=1e-9)


def test_diagnosis_draws_and_states_held_out_records(tmp_path: Path) -> None:
    folder = accelerations.write_campaign(tmp_path / "c")
    found = diagnose_campaign(read_campaign(folder), laws.LawStore(tmp_path / "store"), workers=1)
    (tmp_path / "out").mkdir()
    write_result(found, tmp_path / "out")
    said = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    gain = said["gain"]
    assert 0.0 < gain["rms_nominal_m"] < 3 * gain["rms_noise_m"] < 2e-4
    page = (tmp_path / "out" / "report.html").read_text()
    assert "acceleration (g)" in page
    assert (tmp_path / "out" / "drops.png").stat().st_size > 10_000
    assert {"pixel_scale", "frame_rate", "surface_row"}.isdisjoint(
        name for each in said["causes"] for name in each["causes"]
    )


def test_contact_stays_where_the_record_shows_it(tmp_path: Path) -> None:
    """A model far from the data asks for any contact; the fit must end, and near the blow."""
    folder = accelerations.write_campaign(tmp_path / "c", p_m=2600.0)
    problem, fit_ = prepare(read_campaign(folder), laws.LawStore(tmp_path / "store"), workers=1)
    model = problem.tracks.models[0]
    assert isinstance(model, AccelerationModel)
    start = model.start
    for ask in (-1e3, 1e3):
        moved, _ = model.move(start, np.array([ask, 0.0]), (1.0, 0.01))
        last = float(model.observed.end[-1]) - model.observed.contact_time
        assert abs(moved.contact_time - model.observed.contact_time) <= 0.151 * last
    assert np.isfinite(fit_.evidence)


def test_the_likelihood_has_no_jump_as_contact_moves(tmp_path: Path) -> None:
    """Over three stretches, in steps of a hundredth: χ² and ln det C of a drop, with the errors that begin at contact."""
    folder = accelerations.write_campaign(tmp_path / "c", drops=[(1.0, 12.0, 0.7)])
    problem, fit_ = prepare(read_campaign(folder), laws.LawStore(tmp_path / "store"), workers=1)
    (own,) = (nuisances for nuisances in fit_.nuisances if nuisances.shape == (1, 4))
    stretch = float(np.median(np.diff(problem.tracks.models[0].observed.end)))
    seen = []
    for shift in np.arange(-150, 151) * 0.01 * stretch:
        moved = own + np.array([[shift, 0.0, 0.0, 0.0]])
        (block,) = linearise_at(problem, (moved,), fit_.log_p_m, {})
        seen.append(block.chi_square + block.log_determinant)
    assert np.abs(np.diff(seen)).max() < 0.5


def test_runs_between_nodes_give_no_blow_at_contact(tmp_path: Path) -> None:
    """An interpolated speed at contact is off by a thousandth; within a stretch that would be a hundredth of the peak."""
    folder = accelerations.write_campaign(tmp_path / "c", drops=[(1.0, 12.0, 0.7)])
    problem, fit_ = prepare(read_campaign(folder), laws.LawStore(tmp_path / "store"), workers=1)
    model = problem.tracks.models[0]
    features = model.table.features(fit_.log_p_m, model.start.log_speed, {})
    off = np.concatenate([features[:2], 1.001 * features[2:]])
    seen, beside = (model.predict(each, Instrument(), model.start) for each in (features, off))
    assert np.abs(beside - seen).max() < 1e-6 * seen.max()


def test_errors_of_a_record_do_not_pass_for_its_scale(tmp_path: Path) -> None:
    """A scale that acted on the data would take a hundredth of their χ² for itself, always upwards, and p_m down with it."""
    folder = accelerations.write_campaign(tmp_path / "c", drops=[(1.0, 12.0, 0.7)])
    problem, fit_ = prepare(read_campaign(folder), laws.LawStore(tmp_path / "store"), workers=1)
    model = problem.tracks.models[0]
    assert isinstance(model, AccelerationModel)
    features = model.table.features(fit_.log_p_m, model.start.log_speed, {})
    here = model.predict(features, Instrument(), model.start)
    rough = here + 0.1 * here.max() * np.random.default_rng(1).normal(size=here.size)
    for felt in (here, rough):
        known = replace(model, observed=replace(model.observed, felt=felt))
        (scale,) = known.share(here, lambda factor: here, (0.0, 0.0, 0.0)).values()
        assert scale == pytest.approx(0.01 * here, abs=1e-9)


def test_what_a_setting_of_the_solver_changes_is_an_error_and_no_cause(tmp_path: Path) -> None:
    """No dust has the solver's viscosity. Another code's force differed along what it changes, and it passed for a cause."""
    folder = accelerations.write_campaign(tmp_path / "c", drops=[(1.0, 12.0, 0.7)])
    problem, fit_ = prepare(read_campaign(folder), laws.LawStore(tmp_path / "store"), workers=1)
    settings = {"artificial_viscosity", "resolution"}
    assert set(problem.numerics) == settings <= set(problem.reasons) and not settings & set(problem.effects)
    model = problem.tracks.models[0]
    assert isinstance(model, AccelerationModel)
    amplitude, sigma = model.numerics["artificial_viscosity"]
    assert sigma == problem.numerics["artificial_viscosity"].amplitudes[0].prior.sd
    for changes in model.table.fingerprints["artificial_viscosity"].values():  # what half of it would do
        changes[amplitude] = np.full_like(next(iter(changes.values())), 0.01)
    block = steps.solve_at(problem, steps.ParameterPoint(fit_.log_p_m, {}, fit_.nuisances)).blocks[0]
    features = model.table.features(fit_.log_p_m, model.start.log_speed, {})
    instant = model.start._replace(
        **dict(zip(("contact_time", "log_speed"), fit_.nuisances[0][0], strict=False))
    )
    moved = model.predict(features + 0.01, Instrument(), instant) - model.predict(
        features, Instrument(), instant
    )
    column = moved * sigma / amplitude
    added = block.covariance - fit_.blocks[0].covariance
    n = column.size
    assert added[:n, :n] == pytest.approx(np.outer(column, column), rel=1e-3, abs=1e-3 * np.max(column**2))


def test_a_law_without_a_name_is_a_share_of_what_is_expected_not_of_what_is_recorded(tmp_path: Path) -> None:
    """A share of the record, with p_m in balance, takes that share of its noise away: of a noisy campaign with nothing hidden
    unknown had 0.99."""
    noisy = accelerations.write_campaign(tmp_path / "c", noise=0.05)
    problem, fit_ = prepare(read_campaign(noisy), laws.LawStore(tmp_path / "store"), workers=1)
    reached = law_coordinates(problem, fit_)["reached"]
    for model, instant in zip(problem.tracks.models, problem.tracks.instants(fit_.nuisances[0]), strict=True):
        assert isinstance(model, AccelerationModel)
        there, further = (
            model.predict(model.table.features(log_p_m, instant.log_speed, {}), Instrument(), instant)
            for log_p_m in (fit_.log_p_m + instant.strength, fit_.log_p_m + instant.strength + 1e-2)
        )
        expected = there - instant.strength * (further - there) / 1e-2  # of a sample like the others
        here = np.where(model.below, np.maximum(expected, 0.0), 0.0)
        start = fit_.drops.sections[model.observed.name].start
        assert reached[start : start + here.size] == pytest.approx(here, abs=1e-6 * here.max())
    assert fit_unknown(problem, fit_).evidence < fit_.evidence


@pytest.mark.parametrize("off", [-1.2, -0.5, 0.5, 1.2])
def test_a_contact_that_is_off_finds_back(off: float, tmp_path: Path) -> None:
    """Stretches too early or too late: the force of a round tip begins at nought, so a slope leads to the same χ² as before."""
    folder = accelerations.write_campaign(tmp_path / "c", drops=[(1.0, 12.0, 0.7)])
    problem, fit_ = prepare(read_campaign(folder), laws.LawStore(tmp_path / "store"), workers=1)
    stretch = float(np.median(np.diff(problem.tracks.models[0].observed.end)))
    moved = tuple(
        own + np.array([[off * stretch, 0.0, 0.0]]) if own.shape == (1, 3) else own for own in fit_.nuisances
    )
    place = steps.ParameterPoint(fit_.log_p_m, {}, moved)
    found = steps.converge_nuisances(problem, steps.solve_at(problem, place), 8)
    assert found.chi_square == pytest.approx(fit_.chi_square, abs=0.05)


def test_a_blunt_tip_is_told_that_contact_is_late_by_the_stretch_before_it(tmp_path: Path) -> None:
    """The force would reach into that stretch if contact were earlier: a slope of nought there would leave it late for ever."""
    folder = accelerations.write_campaign(tmp_path / "c", drops=[(1.0, 12.0, 0.7)])
    problem, fit_ = prepare(read_campaign(folder), laws.LawStore(tmp_path / "store"), workers=1)
    model = replace(problem.tracks.models[0], blunt=True)
    assert isinstance(model, AccelerationModel)
    before = int(np.argmax(model.observed.end > model.observed.contact_time)) + 1
    width = float(np.median(model.observed.end - model.observed.begin))
    late = model.start._replace(contact_time=float(model.observed.end[before]) + 0.5 * width)
    features = model.table.features(fit_.log_p_m, late.log_speed, {})
    slope = model.by_contact(features, Instrument(), late)
    assert model.predict(features, Instrument(), late)[before] == pytest.approx(0.0, abs=1e-3)
    assert slope[before] < -0.01 * abs(slope).max()
    assert slope[before - 2] == pytest.approx(0.0, abs=1e-6 * abs(slope).max())


@pytest.mark.parametrize(("tip", "blunt"), [("hemisphere", False), ("flat", True)])
def test_the_force_of_a_round_tip_begins_at_nought(tip: str, blunt: bool) -> None:
    """Simulated speeds, smoothed: at contact a round tip still falls freely, a face is met with a force."""
    run = simulate(DropSetting(Projectile(tip, 0.5e-3, 2e-6), 0.4, Material(p_m=1300.0), spacing=1.25e-4))
    features = extract_speeds(run)
    step = 1e-3 * run.stopping_time
    speed = interpolate_speed(features, np.array([0.0, step]))
    felt = STANDARD_GRAVITY - (speed[1] - speed[0]) / step
    mean = 0.4 / run.stopping_time
    assert is_blunt(make_profile(run.setting.projectile)) is blunt
    assert bool(felt > 0.3 * mean) is blunt
    assert felt < 0.03 * mean or blunt


def test_a_shear_factor_is_felt_as_its_square_of_tension() -> None:
    """Y is a root of the product of both strengths, and a drop hardly pulls its dust apart."""
    drop = DropSetting(Projectile("hemisphere", 0.5e-3, 2e-6), 0.4, Material(p_m=1300.0), spacing=1.25e-4)
    weaker = drop.material.tensile_log10_a + 2.0 * math.log10(0.52)
    changes = ({}, {"shear_factor": 0.52}, {"tensile_log10_a": weaker})
    features = [
        extract_speeds(simulate(drop.replace(material=drop.material.replace(**change)))) for change in changes
    ]
    plain, shear, tension = features
    np.testing.assert_allclose(shear[:2], tension[:2], atol=5e-4)
    np.testing.assert_allclose(shear[2:], tension[2:], atol=5e-4)
    assert np.all(np.abs(shear[:2] - plain[:2]) > 0.05)


@pytest.mark.parametrize("overshoot", [-0.9, -1.0, -1.3])
def test_nuisances_that_go_to_and_fro_settle(overshoot: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """A step that ends ``overshoot`` times as far off as it began, on the other side, ends at the best after all."""

    def follow(
        problem: object, here: SimpleNamespace, log_p_m: float, values: dict
    ) -> tuple[steps.ParameterPoint, float]:
        (off,) = here.place.nuisances
        return steps.ParameterPoint(log_p_m, values, (overshoot * off,)), float(abs(off[0]))

    monkeypatch.setattr(steps, "_follow", follow)
    monkeypatch.setattr(
        steps, "solve_at", lambda problem, place: SimpleNamespace(place=place, log_posterior=0.0)
    )
    begin = SimpleNamespace(place=steps.ParameterPoint(0.0, {}, (np.array([1.0]),)), log_posterior=0.0)
    end = steps.converge_nuisances(None, begin, 12)  # type: ignore[arg-type]
    assert abs(end.place.nuisances[0][0]) < 0.1
