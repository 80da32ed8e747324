"""``labsim materials``: all laws of the folder, one by name, one from a file."""

from __future__ import annotations

import json
import shutil

import pytest

import labsim.cli
from labsim.sph.materials import SHELF, find_law, list_laws


def run(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    with pytest.raises(SystemExit) as left:
        labsim.cli.main(["materials", *words])
    assert left.value.code == 0
    return capsys.readouterr().out


def test_all_laws_with_all_parameters(capsys: pytest.CaptureFixture[str]) -> None:
    laws = {each["name"]: each for each in json.loads(run(capsys, "--json"))["laws"]}
    assert list(laws) == list_laws()
    for name, law in laws.items():
        module = find_law(name)
        assert [each["name"] for each in law["parameters"]] == [each.name for each in module.PARAMETERS]
        assert law["calibrated"]["name"] == module.CALIBRATED.name
        assert all(each["source"] for each in law["parameters"])


@pytest.mark.parametrize("columns", ["80", "140"])
@pytest.mark.parametrize("law", list_laws())
def test_one_law_as_text(law: str, columns: str, capsys, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    text = run(capsys, law)
    module = find_law(law)
    assert text.startswith(f"{law}: ") and "calibrated" in text
    for each in module.PARAMETERS:
        assert each.name in text and f"{each.default:g}" in text
    assert all(name not in text for name in list_laws() if name != law)


def test_a_law_of_your_own(tmp_path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "my_clay.py"
    shutil.copy(SHELF.folder / "von_mises.py", path)
    (law,) = json.loads(run(capsys, str(path), "--json"))["laws"]
    assert law["name"] == "my_clay" and law["file"] == str(path)


def test_a_law_that_is_none(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        labsim.cli.main(["materials", "mud"])
    assert left.value.code == 2
    assert "drucker_prager_cap, p_alpha, porous_dust, von_mises" in capsys.readouterr().err
