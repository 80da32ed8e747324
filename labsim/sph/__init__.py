"""The bundled SPH solver: a drop setting in, depth against time and the filling factor out. SI throughout."""

from .convergence import ConvergedRun, extrapolate, refine, simulate_spacings
from .drop import simulate
from .materials import solver_hash
from .run import DropRun, Particles
from .setting import DropSetting, Numerics, check_setting

__all__ = [
    "ConvergedRun",
    "DropRun",
    "DropSetting",
    "Numerics",
    "Particles",
    "check_setting",
    "extrapolate",
    "refine",
    "simulate",
    "simulate_spacings",
    "solver_hash",
]
