"""Kinds of measurement beside drops and scans: one file each, here or in a campaign's ``observations/``, found by listing.

A file has ``observe(campaign)``, which reads what the campaign's folder holds of its kind and returns an Observation
(inference/observation.py), or None where there is nothing.
"""

from __future__ import annotations

import hashlib
import importlib
import pkgutil
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

from ...errors import InferenceError, LabsimError
from ...records import Campaign
from ...sph.plugins import load_module
from ..observation import Observation


def list_own_files(folder: Path) -> list[Path]:
    """The files that a campaign brings along; none of them is run."""
    return sorted(file for file in (folder / "observations").glob("*.py") if not file.name.startswith("_"))


def observe_further(campaign: Campaign) -> list[Observation]:
    """Everything in a campaign that is neither a drop nor a scan, in the order of the kinds' names.

    Raises LabsimError subclasses as the kinds do, InferenceError for a file of the campaign that cannot be run.
    """
    found = []
    for module in _list_kinds(campaign.folder):
        try:
            observation = module.observe(campaign)
        except LabsimError:
            raise
        except Exception as trouble:
            raise InferenceError(
                module.__file__ or module.__name__,
                "observe",
                f"failed ({type(trouble).__name__}: {trouble}); correct it",
            ) from trouble
        if observation is not None:
            found.append(observation)
    return found


def _list_kinds(folder: Path) -> Iterator[ModuleType]:
    for info in pkgutil.iter_modules(__path__):
        yield importlib.import_module(f"{__name__}.{info.name}")
    for file in list_own_files(folder):
        try:
            content = hashlib.sha256(file.read_bytes()).hexdigest()[:16]
            yield load_module(file, f"labsim_observations_{content}")
        except Exception as trouble:
            raise InferenceError(
                file, "", f"cannot be loaded ({type(trouble).__name__}: {trouble}); correct the file"
            ) from trouble
