"""What a result rests on, as BibTeX; and every reference that the package names stands in references.bib."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

import labsim
from labsim.cli import app
from labsim.cli.cite import find_keys, read_references
from labsim.effects import list_effects
from labsim.effects.terms import list_terms
from labsim.errors import LabsimError
from labsim.sph.materials import find_law, list_laws

DATA = Path(__file__).parents[2] / "data"


def cite(folder: Path) -> dict:
    done = CliRunner().invoke(app, ["cite", str(folder), "--json"])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    return {each["key"]: each for each in json.loads(done.stdout)["entries"]}


def write(folder: Path, name: str, campaign: Path | None = None, **summary: object) -> Path:
    inputs = {} if campaign is None else {str(campaign): "0"}
    (folder / name).write_text(json.dumps({**summary, "made_by": {"inputs": inputs}}))
    return folder


def test_authors_and_year_are_the_key():
    text = "Blum & Schräpler (2004): growth; Güttler et al. (2009b), eq. 6; Seizinger, Speith & Kley (2012)"
    text += "; Carroll & Holt\n(1972)"
    assert find_keys(text) == ["blum2004", "guttler2009b", "seizinger2012", "carroll1972"]
    assert find_keys("a decade, Einav & Randolph (2005), and Hill (1950)") == ["einav2005", "hill1950"]
    assert find_keys("Free fall: g = 9.81 (about) in 2004, Table (3)") == []


def test_every_reference_of_the_package_has_an_entry():
    texts = [text for effect in list_effects().values() for text in effect.references]
    texts += [term.source for term in list_terms().values()]
    for name in list_laws():
        law = find_law(name)
        texts += [law.__doc__, *(each.source for each in law.PARAMETERS)]
        assert find_keys(" ".join(texts[-1 - len(law.PARAMETERS) :])), name
    named = {key for text in texts for key in find_keys(text)}
    assert len(named) > 15 and named <= set(read_references())
    assert not [text for text in texts if "et al" in text and not find_keys(text)]


def test_entries_are_whole():
    text = (Path(labsim.__file__).parent / "references.bib").read_text(encoding="utf-8")
    references = read_references()
    assert len(references) == text.count("\n@")
    for key, entry in references.items():
        assert entry.count("{") == entry.count("}") and "author = " in entry and "title = " in entry, key
        assert key == "labsim" or f"year = {{{key.rstrip('abc')[-4:]}}}" in entry
    assert f"version = {{{labsim.__version__}}}" in references["labsim"]


def test_a_cause_that_was_found_brings_its_references(tmp_path: Path):
    campaign = DATA / "campaigns/p03"
    common = {"scatter": {}, "law": None}
    found = cite(
        write(tmp_path, "diagnosis.json", campaign, verdict="effect", named=[["surface_crust"]], **common)
    )
    assert found["weidling2009"]["for"] == ["the cause surface_crust"]
    assert {"labsim", "guttler2009", "monaghan1992", "foreman-mackey2013", "patterson1971"} < set(found)
    nothing = cite(write(tmp_path, "diagnosis.json", campaign, verdict="none", named=[["none"]], **common))
    assert "weidling2009" not in nothing and set(nothing) < set(found)


def test_a_learned_law_and_a_law_of_the_setting(tmp_path: Path):
    law = {"terms": [{"term": "inertial_drag"}]}
    found = cite(write(tmp_path, "diagnosis.json", verdict="unknown", law=law))
    assert found["katsuragi2007"]["for"] == ["the learned term inertial_drag"]
    (tmp_path / "diagnosis.json").unlink()
    found = cite(write(tmp_path, "run.json", setting={"material": {"law": "p_alpha"}}))
    assert {"herrmann1969", "carroll1972"} < set(found) and "guttler2009" not in found
    assert "foreman-mackey2013" not in found


def test_a_track_rests_on_the_program(tmp_path: Path):
    assert set(cite(write(tmp_path, "drop.json"))) == {"labsim"}


def test_a_folder_without_a_result_is_refused(tmp_path: Path):
    with pytest.raises(LabsimError, match="holds no summary"):
        cite(tmp_path)
