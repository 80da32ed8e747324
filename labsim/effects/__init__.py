"""The catalogue of what a simulation can get wrong: one file per effect, found by listing ``catalogue``.

Input: a drop setting or an instrument, and the values of an effect's parameters. Output: the setting or the instrument
with the effect. Nothing is simulated and nothing is compared here.
"""

from .contract import (
    KINDS,
    OBSERVABLES,
    Effect,
    Instrument,
    Kind,
    Parameter,
    Place,
    Values,
    all_pushed,
    deepest_dust,
    deepest_expected,
    find_middle,
    list_impacts,
    list_places,
)
from .loading import CATALOGUE, list_effects, load_effect, load_file, reference_campaign
from .model import Model, apply_effects, apply_model, check_model, make_instrument, read_model, write_model
from .priors import Cauchy, HalfNormal, LogNormal, Normal, Prior, Uniform

__all__ = [
    "CATALOGUE",
    "KINDS",
    "OBSERVABLES",
    "Cauchy",
    "Effect",
    "HalfNormal",
    "Instrument",
    "Kind",
    "LogNormal",
    "Model",
    "Normal",
    "Parameter",
    "Place",
    "Prior",
    "Uniform",
    "Values",
    "all_pushed",
    "apply_effects",
    "apply_model",
    "check_model",
    "deepest_dust",
    "deepest_expected",
    "find_middle",
    "list_effects",
    "list_impacts",
    "list_places",
    "load_effect",
    "load_file",
    "make_instrument",
    "read_model",
    "reference_campaign",
    "write_model",
]
