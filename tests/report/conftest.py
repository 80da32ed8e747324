"""Reports of made-up campaigns: the diagnosis is real, only the runs obey a law in closed form (laws.py)."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import laws
import pytest

from labsim.campaign import read_campaign
from labsim.diagnosis.campaign import Diagnosis, diagnose_campaign
from labsim.diagnosis.published.campaign import diagnose_summary
from labsim.inference.calibrate import calibrate
from labsim.inference.published.calibrate import calibrate_summary
from labsim.report.outputs import write_result

SEED = Path(__file__).parents[2] / "data" / "guettler2009"
HOSTILE = "<script>document.title='ran'</script>"


@pytest.fixture(scope="session")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("reports")


def write(found: Diagnosis, folder: Path) -> Path:
    folder.mkdir(exist_ok=True)
    write_result(found, folder)
    return folder


@pytest.fixture(scope="session")
def effect_found(place: Path) -> Diagnosis:
    """Strength that grows with the rate of compression; its name tries to run a script."""
    folder = laws.write_campaign(place / "campaign-effect", rate=0.05, name=HOSTILE, description=HOSTILE)
    return diagnose_campaign(read_campaign(folder), laws.LawStore(place / "store"), workers=1)


@pytest.fixture(scope="session")
def effect(effect_found: Diagnosis, place: Path) -> Path:
    return write(effect_found, place / "effect")


@pytest.fixture(scope="session")
def none(place: Path) -> Path:
    """Drops that obey the very law that the runs obey: one model, no gain."""
    campaign = read_campaign(laws.write_campaign(place / "campaign-none"))
    return write(diagnose_campaign(campaign, laws.LawStore(place / "store"), workers=1), place / "none")


@pytest.fixture(scope="session")
def unknown(place: Path) -> Path:
    """Every other drop 8 % deeper than the law, the others 8 % shallower; with a scan, which enters the likelihood, and a second
    one that is left out."""
    folder = laws.write_campaign(place / "campaign-unknown", bent=0.05, scan=True)
    campaign = read_campaign(folder)
    found = diagnose_campaign(campaign, laws.LawStore(place / "store"), workers=1, use_scans=True)
    lost = dataclasses.replace(campaign.scans[0], name="C02", slices=folder / "nowhere")
    return write(
        dataclasses.replace(
            found,
            campaign=dataclasses.replace(campaign, scans=(*campaign.scans, lost)),
            warnings=(*found.warnings, "scan C02 left out: it holds no bead & <b>nothing</b> else"),
        ),
        place / "unknown",
    )


@pytest.fixture(scope="session")
def calibrated(place: Path) -> Path:
    """A calibration of a single drop."""
    campaign = read_campaign(laws.write_campaign(place / "campaign-one", drops=laws.DROPS[2:3]))
    folder = place / "calibrated"
    folder.mkdir()
    write_result(calibrate(campaign, store=laws.LawStore(place / "store")), folder)
    return folder


@pytest.fixture(scope="session")
def published(place: Path) -> Path:
    """Published figures with runs of the law instead of the solver's."""
    store = laws.LawStore(place / "store")
    calibration = calibrate_summary(read_campaign(SEED), store, workers=1)
    folder = place / "published"
    folder.mkdir()
    write_result(diagnose_summary(calibration, store, workers=1), folder)
    return folder


def load(folder: Path, name: str) -> dict:
    return json.loads((folder / name).read_text())
