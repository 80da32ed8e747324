"""What can go wrong, as exceptions whose text is one line that a user can act on.

Every message has the form ``FILE: KEY: what is wrong and what would be right``; the command line prints it
after ``error:`` and leaves with status 2.
"""

from __future__ import annotations


class LabsimError(Exception):
    """Anything labsim reports to its user instead of a traceback.

    Parameters
    ----------
    where : object
        File or folder that it is about.
    key : str
        Which of its values; empty for the whole.
    message : str
        What is wrong with it, and what would do.
    """

    def __init__(self, where: object, key: str, message: str) -> None:
        self.where, self.key, self.message = str(where), key, message
        super().__init__(": ".join(part for part in (self.where, self.key, message) if part))

    def __reduce__(self) -> tuple:
        return type(self), (self.where, self.key, self.message)  # it crosses processes


class CampaignError(LabsimError):
    """A campaign folder that cannot be used as it stands."""


class MeasurementError(LabsimError):
    """A video, a track or a stack of slices from which nothing trustworthy can be read."""


class SimulationError(LabsimError):
    """A setting that cannot be simulated, or a run that blew up (named with its parameters)."""


class InferenceError(LabsimError):
    """A calibration or a diagnosis that has nothing to stand on."""


class ExtrapolationError(InferenceError):
    """The runs that there are say nothing about a point of the parameters; a candidate that leads there is none."""


class EffectError(LabsimError):
    """An effect's file that breaks the contract, or a value that an effect does not take."""
