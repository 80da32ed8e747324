"""What a fit knows of the data, whatever instrument took them.

Data that share no error with the rest are one Observation: all drops of a campaign (cameras and the solver err alike in them),
each map of the compacted dust, the undisturbed dust of all scans. Fits, screening and judging ask nothing else of them than
what stands here, so that another kind of measurement is one more file with a class of this shape.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from ..records import FloatArray
from .blocks import Block
from .drop_terms import Probe, Terms
from .forward import ResponseTable


@dataclass(frozen=True)
class RunFeatures:
    """Runs of one family, (number ``family``), as an observation takes them. encode : the part of a run that it reads -> (m,)
    features, smooth in ln speed and ln p_m; table : what keeps and interpolates them."""

    family: int
    table: ResponseTable
    encode: Callable[[Any], FloatArray]


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
        nominal: Probe,
        terms: Terms,
        probes: Mapping[str, Probe],
    ) -> Block:
        """Residual, covariance and tangents about the point ``nominal``; probes : name of a global -> the point after a step of
        it, for its tangent by finite differences."""

    def follow(self, nuisances: FloatArray, block: Block, weighted: FloatArray) -> tuple[FloatArray, float]:
        """Nuisances at their best as seen from ``block``, and the largest move (1 is a prior width or a frame).

        weighted : (n,) inverse covariance times what is left of the residual.
        """
