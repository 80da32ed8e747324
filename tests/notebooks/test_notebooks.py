"""The notebooks run from top to bottom, show what they promise, and are kept without outputs."""

from __future__ import annotations

import base64
import os
import re
from pathlib import Path

import cv2
import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient

FOLDER = Path(__file__).parents[2] / "notebooks"
GALLERY = {  # which of its pictures stands for a notebook in docs/gallery.md; LABSIM_REWRITE_DOCS=1 draws them anew
    "track_projectile": 1, "density_contour": 1, "calibrate_p_m": 1, "find_the_cause": 0, "real_soundings": 1,
    "seed_experiment": 0, "acceleration_records": 0, "static_tests": 0,
    "learn_the_missing_law": 0,
}  # fmt: skip
LONGEST = 900  # s for one cell on a loaded machine
# name -> (pictures, what the printed text must hold)
NOTEBOOKS = {
    "track_projectile": (3, [r"impact speed +0\.62\d", r"true over stated frame rate .*0\.9[45]"]),
    "density_contour": (
        4,
        [r"undisturbed dust 0\.1[45]", r"denser than 0\.20: 0\.\d+ ± 0\.\d+ sphere volumes"],
    ),
    "calibrate_p_m": (3, [r"p_m = 1[12]\d\d Pa", r"\d+ runs new"]),
    "seed_experiment": (
        3,
        [
            r"508 stored runs",
            r"ratio at equal speed 3\.00",
            r"stored stopping time 0\.9[78]\d",
            r"nominal: T_s ratio 2\.4",
        ],
    ),
    "real_soundings": (
        2,
        [
            r"verdict: effect",
            r"strength_rate, alone or beside another: (0\.9\d|1\.00)",
            r"nominal: rms [45]",
            r"with the cause: rms [12]\.",
            r": none, 0\.[5-9]",
        ],
    ),
    "acceleration_records": (
        3,
        [
            r"D05: 0\.410 m/s at contact, 1\.2\d\d ± 0\.0\d\d mm deep",
            r"p_m = 1[6-8]\d\d ± \d+ Pa; it scatters by ([6-9]|1\d) %",
            r"p_m = 1[6-9]\d\d ± \d+ Pa \(true 1780\); it scatters by [1-3] %",
            r"grows by 0\.[23]\d ± 0\.0\d \(true",
        ],
    ),
    "static_tests": (
        1,
        [
            r"compression_omnidirectional, p-value 0\.\d+\n +p_m = 1[23]\.\d+ ± 0\.\d+ kPa\n +phi_1 = 0\.12",
            r"p_m at rest 1[23]\.\d+ ± 0\.\d+ kPa \(published 13\), (9|10)\.\d times",
        ],
    ),
    "learn_the_missing_law": (
        2,
        [
            r"verdict: unknown",
            r" 0\.0 behind +inertial_drag: \(\d{3} ± \d+\) Pa s²/m² × v²\n",
            r"inertial_drag = \d+",
        ],
    ),
    "find_the_cause": (3, [r"verdict: effect", r"pixel_scale +(1|0\.9\d*)\n"]),
}
# what runs after the last cell of a notebook, with all that its cells made
MORE = {
    # each drop of the campaign: the depth that the formula's fit says, and that of the command with the report's model.toml
    "learn_the_missing_law": """
from labsim.cli import main

fit, problem = best.fit, found.learned.problem
offsets = problem.log_offsets(fit.values)
for seen, instant in zip(problem.tracks.models, problem.tracks.instants(fit.nuisances[0]), strict=True):
    name, radius = seen.observed.name, seen.radius
    features = seen.table.features(fit.log_p_m + offsets[name], instant.log_speed, fit.values)
    asked = ["--campaign", str(campaign.folder), "--drop", name, "--model", str(out / "model.toml")]
    asked += ["--speed-m-s", repr(float(np.exp(instant.log_speed))), "--spacing-um", repr(1e6 * radius / 4)]
    try:
        main(["simulate", "-o", str(out / name), "--workers", "1", "--quiet", *asked])
    except SystemExit as left:
        assert not left.code
    depth = json.loads((out / name / "run.json").read_text())["penetration_depth_m"]
    print(f"{name} as told {1e3 * np.exp(features[0]):.5f} mm, simulated {1e3 * depth:.5f} mm")
""",
}


def check_the_learned_law(printed: str) -> None:
    """The law predicts what nobody showed it better than the nominal model, and simulate does what the fit says."""
    without, with_law = map(float, re.findall(r"held-out rms ([\d.]+) to ([\d.]+) µm", printed)[0])
    assert with_law < 0.5 * without
    heavier = re.findall(r"depth off by (\S+) % without, (\S+) % with the law", printed)
    assert len(heavier) == 3
    for before, after in heavier:
        assert abs(float(after)) < abs(float(before)), heavier
    drops = re.findall(r"(\w+) as told (\S+) mm, simulated (\S+) mm", printed)
    assert len(drops) == 9
    for _, told, simulated in drops:
        assert float(simulated) == pytest.approx(float(told), rel=0.01), drops


CLOSER = {"learn_the_missing_law": check_the_learned_law}


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.ipynb")), ids=lambda path: path.stem)
def test_kept_small_and_without_outputs(path: Path) -> None:
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    assert path.stat().st_size <= 1_000_000
    assert notebook.cells[0].cell_type == "markdown" and notebook.cells[0].source.startswith("# ")
    if path.stem in NOTEBOOKS:
        assert all(not cell.get("outputs") and cell.get("execution_count") is None for cell in notebook.cells)


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_runs_and_shows_what_it_promises(
    name: str, shared_store: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LABSIM_STORE", shared_store)
    notebook = nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)
    if name in MORE:
        notebook.cells.append(nbformat.v4.new_code_cell(MORE[name]))
    NotebookClient(
        notebook, timeout=LONGEST, kernel_name="python3", resources={"metadata": {"path": str(FOLDER)}}
    ).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    pictures = [o["data"]["image/png"] for o in outputs if "image/png" in o.get("data", {})]
    count, promises = NOTEBOOKS[name]
    assert len(pictures) == count
    for picture in pictures:
        pixels = cv2.imdecode(np.frombuffer(base64.b64decode(picture), np.uint8), cv2.IMREAD_GRAYSCALE)
        assert pixels.shape[0] > 150 and pixels.std() > 5, "an empty figure"
    if os.environ.get("LABSIM_REWRITE_DOCS"):
        drawn = FOLDER.parent / "docs/pictures" / f"notebook-{name}.png"
        drawn.write_bytes(base64.b64decode(pictures[GALLERY[name]]))
    printed = "".join(o.text for o in outputs if o.output_type == "stream" and o.name == "stdout")
    for promise in promises:
        assert re.search(promise, printed), printed
    if name in CLOSER:
        CLOSER[name](printed)
    complaints = "".join(o.text for o in outputs if o.output_type == "stream" and o.name == "stderr")
    assert "Warning" not in complaints, complaints
