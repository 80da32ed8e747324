"""The same seed, the same numbers: whatever the number of threads, workers and starts; ``labsim rerun`` says so."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from labsim.cli._compare import compare_folders
from labsim.cli.rerun import read_made_by
from labsim.errors import LabsimError

QUICK = "--geometry planar --set material.bulk_modulus_Pa=4500 --spacing-um 125 --speed-m-s 0.3".split()
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")


def finish(process) -> str:  # type: ignore[no-untyped-def]
    _out, said = process.communicate(timeout=600)
    assert process.returncode == 0, said
    return said


def test_threads_change_nothing(begin, tmp_path: Path, campaign: Path) -> None:
    for count in ("1", "2"):
        threads = dict.fromkeys(THREADS, count)
        store = tmp_path / f"store{count}"
        finish(begin("simulate", *QUICK, "-q", "-o", tmp_path / f"run{count}", store=store, **threads))
        finish(
            begin("track", campaign, "-q", "-o", tmp_path / f"track{count}", "--workers", count, **threads)
        )
    for name in ("run", "track"):
        found = compare_folders(tmp_path / f"{name}1", tmp_path / f"{name}2")
        assert found.same and found.numbers > 100, found.differences


@pytest.mark.slow
def test_a_calibration_is_the_same_with_any_number_of_workers_and_threads(
    begin, tmp_path: Path, campaign: Path
) -> None:
    for count in ("1", "2"):
        arguments = ("calibrate", campaign, "-q", "-o", tmp_path / f"out{count}", "--workers", count)
        finish(begin(*arguments, store=tmp_path / f"store{count}", **dict.fromkeys(THREADS, count)))
    found = compare_folders(tmp_path / "out1", tmp_path / "out2")
    assert found.same and found.numbers > 1000, found.differences


def test_rerun_repeats_and_compares(begin, tmp_path: Path) -> None:
    finish(begin("simulate", *QUICK, "-q", "-o", tmp_path / "out"))
    made_by = json.loads((tmp_path / "out" / "run.json").read_text())["made_by"]
    assert {"command", "versions", "solver", "seed", "inputs", "processor"} <= set(made_by)
    finish(begin("rerun", tmp_path / "out", "-q", "-o", tmp_path / "again"))
    summary = json.loads((tmp_path / "again" / "rerun.json").read_text())
    assert summary["same"] and summary["numbers"] > 1000 and summary["changed_since"] == {}
    file = tmp_path / "out" / "curve.csv"
    lines = file.read_text().splitlines()
    lines[5] = lines[5].replace(lines[5].split(",")[1], "1e-9")
    file.write_text("\n".join(lines) + "\n")
    process = begin("rerun", tmp_path / "out", "--stored", "-o", tmp_path / "other")
    printed, _said = process.communicate(timeout=300)
    assert process.returncode == 1 and "curve.csv" in printed and "1 of" in printed


def test_inputs_that_changed_are_named(begin, tmp_path: Path, campaign: Path) -> None:
    drop = campaign / "drops" / "D05"
    finish(begin("track", drop, "-q", "-o", tmp_path / "out"))
    file = drop / "track.csv"
    file.write_text(file.read_text() + "\n")
    process = begin("rerun", tmp_path / "out", "-o", tmp_path / "again")
    printed, _said = process.communicate(timeout=300)
    assert process.returncode == 0 and f"changed since: {drop}" in printed


@pytest.mark.parametrize(
    "command", [["new", "evil"], ["runs", "prune", "--everything"], ["rerun", "."], ["--version"]]
)
def test_a_summary_cannot_have_anything_run(tmp_path: Path, command: list[str]) -> None:
    """Only what writes into an output folder of its own is repeated, whatever a run.json says."""
    made_by = {
        "command": ["labsim", *command],
        "folder": str(tmp_path),
        "versions": {},
        "solver": "",
        "inputs": {},
    }
    (tmp_path / "run.json").write_text(json.dumps({"made_by": made_by}))
    with pytest.raises(LabsimError, match="is not repeated"):
        read_made_by(tmp_path)
