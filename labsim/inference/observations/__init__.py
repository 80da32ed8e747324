"""What a fit knows of the data, whatever instrument took them; and the kinds of measurement, one file each.

Data that share no error with the rest are one Observation: all drops of a campaign (``tracks``: cameras and the solver err alike
in them), all maps of compacted dust (``compacted_zone``), the undisturbed dust of all scans (``undisturbed``), static tests
(``static_tests``). Fits, screening and judging ask nothing else of them than what stands here.

A further kind is one file here, or in a campaign's ``observations/``, found by listing: ``observe(campaign)`` reads what the
campaign's folder holds of it and returns an Observation, or None where there is nothing. Drops and scans come measured already
(inference/measure.py), so their files have none.
"""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, Protocol, runtime_checkable

import numpy as np

from ...errors import InferenceError, LabsimError
from ...extensions import announce_code, list_modules
from ...records import Campaign, FloatArray
from ...sph.plugins import load_module
from ..emulation.forward import ResponseTable
from ..fits.blocks import Block
from .linearised_drop import ErrorBudget, Perturbation


@dataclass(frozen=True)
class RunFeatures:
    """Runs of one group, (number ``group``), as an observation takes them. extract : run -> the (m,) features
    that the observation reads, smooth in ln speed and ln p_m; table : what keeps and interpolates them."""

    group: int
    table: ResponseTable
    extract: Callable[[Any], FloatArray]


@runtime_checkable
class Observation(Protocol):
    """Data whose errors are their own. Nuisances are arrays of the observation's own shape; an empty one where it has none."""

    @property
    def kind(self) -> str:
        """What an unknown cause may change together: "drops", "map", "undisturbed dust", or a name of the kind's own."""

    @property
    def name(self) -> str:
        """What a person calls these data: "drops", "map C01"."""

    @property
    def features(self) -> Sequence[RunFeatures]:
        """The runs it rests on; none where its data follow from the setting alone."""

    def begin(self) -> FloatArray:
        """Nuisances as stated, where a fit begins."""

    def linearise(
        self,
        nuisances: FloatArray,
        log_p_m: float,
        nominal: Perturbation,
        budget: ErrorBudget,
        perturbations: Mapping[str, Perturbation],
    ) -> Block:
        """Residual, covariance and tangents about the point ``nominal``; perturbations : name of a global -> the point after
        a step of it, for its tangent by finite differences."""

    def follow(self, nuisances: FloatArray, block: Block, weighted: FloatArray) -> tuple[FloatArray, float]:
        """Nuisances at their best as seen from ``block``, and the largest move (1 is a prior width or a frame).

        weighted : (n,) inverse covariance times what is left of the residual.
        """


class WithoutNuisances:
    """The part of an Observation that has nothing to follow."""

    def begin(self) -> FloatArray:
        return np.empty(0)

    def follow(self, nuisances: FloatArray, block: Block, weighted: FloatArray) -> tuple[FloatArray, float]:
        return nuisances, 0.0


class Direct(WithoutNuisances, ABC):
    """An Observation whose data follow from the setting alone: no runs, no nuisances. A kind has ``kind`` and ``name``, and says
    what it expects and how its data compare with that."""

    features: Sequence[RunFeatures] = ()

    @abstractmethod
    def expect(self, log_p_m: float, point: Perturbation) -> FloatArray:
        """What a true model gives at a point, (n,)."""

    @abstractmethod
    def compare(self, expected: FloatArray, tangents: Mapping[str, FloatArray], budget: ErrorBudget) -> Block:
        """The data with their errors about what is expected."""

    def linearise(
        self,
        nuisances: FloatArray,
        log_p_m: float,
        nominal: Perturbation,
        budget: ErrorBudget,
        perturbations: Mapping[str, Perturbation],
    ) -> Block:
        here = self.expect(log_p_m, nominal)
        tangents = {"ln_p_m": (self.expect(log_p_m + 1e-3, nominal) - here) / 1e-3}
        for name, point in perturbations.items():
            tangents[name] = (self.expect(log_p_m, point) - here) / point.step
        return self.compare(here, tangents, budget)


def list_own_files(folder: Path) -> list[Path]:
    """The files that a campaign brings along; none of them is run."""
    return sorted(file for file in (folder / "observations").glob("*.py") if not file.name.startswith("_"))


def observe_further(campaign: Campaign) -> list[Observation]:
    """Everything in a campaign that is neither a drop nor a scan, in the order of the kinds' names.

    Raises LabsimError subclasses as the kinds do, InferenceError for a file of the campaign that cannot be run.
    """
    found = []
    for module in _list_kinds(campaign.folder):
        if not hasattr(module, "observe"):
            if module.__name__.startswith(__name__):
                continue  # drops and scans, and what they are made of
            raise InferenceError(module.__file__ or "", "observe", "is missing; write def observe(campaign)")
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
    yield from list_modules(__name__, "labsim.observations").values()
    for file in list_own_files(folder):
        announce_code(file.resolve())
        try:
            content = hashlib.sha256(file.read_bytes()).hexdigest()[:16]
            yield load_module(file, f"labsim_observations_{content}")
        except Exception as trouble:
            raise InferenceError(
                file, "", f"cannot be loaded ({type(trouble).__name__}: {trouble}); correct the file"
            ) from trouble
