"""Where the data are missed is said: drops whose motion is wrong, maps whose dust is."""

import laws
import numpy as np

from labsim.campaign import read_campaign
from labsim.diagnosis.misfit import measure_misfit, say_misfit
from labsim.inference.calibrate import prepare


def look(tmp_path, **changes):
    campaign = read_campaign(laws.write_campaign(tmp_path / "made", scan=True, **changes))
    problem, fit = prepare(campaign, laws.LawStore(tmp_path / "store"), workers=1)
    return measure_misfit(problem, fit)


def test_nothing_is_missed_where_nothing_is_wrong(tmp_path):
    parts = look(tmp_path)
    assert [part.name for part in parts] == ["drops", "rebounds", "map C01", "undisturbed dust"]
    drops, rebounds, scanned, _ = (part.sections for part in parts)
    assert [drop.name for drop in drops] == [f"D{k:02d}" for k in range(1, 7)]
    assert {one.name for one in rebounds} <= {drop.name for drop in drops}
    assert [one.name for one in scanned] == ["C01"]
    assert not any(part.missed for part in parts) and say_misfit(parts) == ""


def test_drops_that_move_otherwise_are_named(tmp_path):
    parts = look(tmp_path, bent=0.05)
    said = say_misfit(parts)
    assert said.startswith("misses drops (χ²") and said.endswith(
        "it meets rebounds, map C01, undisturbed dust"
    )
    assert any(drop.missed for drop in parts[0].sections)


def test_a_map_whose_dust_is_otherwise_is_named_with_the_place(tmp_path, monkeypatch):
    """The simulated dust has less than a third of the compaction that is scanned."""
    plain = laws.make_dust

    def make(radius, depth, phi0):
        dust = plain(radius, depth, phi0)
        dust.filling_factor[:] = phi0 + 0.3 * (dust.filling_factor - phi0)
        return dust

    monkeypatch.setattr(laws, "make_dust", make)
    parts = look(tmp_path)
    said = say_misfit(parts)
    assert said.startswith("misses map C01 (χ²") and "denser than simulated under the tip" in said
    assert "it meets drops" in said


def test_drops_of_a_true_model_are_not_named(tmp_path):
    """The runs of this law have none of the solver's error that the likelihood allows, so p values lie above uniform ones."""
    found = []
    for k in range(4):
        found += [drop.p_value for drop in look(tmp_path / str(k), seed=k)[0].sections]
    assert np.mean(found) > 0.4
    assert sum(p < 0.05 for p in found) <= 3  # of 24
