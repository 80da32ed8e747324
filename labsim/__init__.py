"""labsim: laboratory drops into porous dust, linked to an SPH simulation of the same drops.

What a script or a notebook needs stands here; everything is loaded when it is first asked for, so ``import labsim`` is quick::

    campaign = labsim.read_campaign("my-drops")
    print(labsim.calibrate(campaign).posterior.samples("p_m_Pa").mean())
    print(labsim.diagnose(campaign).verdict.word)

SI everywhere. Every error is a LabsimError whose text is one line that says what to do.
"""

from __future__ import annotations

import importlib
import os
from typing import Any

# OpenCV reads this once, when its first video is opened: damage is reported by labsim, in one line of its own words
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")

__version__ = "0.1.0"

# public name -> the module that holds it
_PLACES = {
    "read_campaign": "campaign",
    "track": "api",
    "reduce_scan": "api",
    "simulate": "api",
    "calibrate": "api",
    "diagnose": "api",
    "tabulate": "api",
    "summarise": "api",
    "plot": "api",
    "plot_drops": "api",
    "write_report": "api",
    "load": "results",
    "example": "examples",
    "LabsimError": "errors",
    "Material": "records",
    "Projectile": "records",
    "Camera": "records",
    "Measured": "records",
    "DropSetting": "sph",
    "RunStore": "runs.store",
}

__all__ = [
    "Camera", "DropSetting", "LabsimError", "Material", "Measured", "Projectile", "RunStore", "__version__",
    "calibrate", "diagnose", "example", "load", "plot", "plot_drops", "read_campaign", "reduce_scan", "simulate",
    "summarise", "tabulate", "track", "write_report",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module 'labsim' has no attribute {name!r}")
    found = getattr(importlib.import_module(f".{_PLACES[name]}", __name__), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted(__all__)  # what a script needs, and nothing that this file imports
