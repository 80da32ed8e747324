"""The bundled SPH solver: a drop setting in, depth against time and the filling factor out. SI throughout."""

from ._jit import solver_hash
from .drop import simulate
from .run import DropRun, Particles
from .setting import DropSetting, Numerics, check_setting

__all__ = ["DropRun", "DropSetting", "Numerics", "Particles", "check_setting", "simulate", "solver_hash"]
