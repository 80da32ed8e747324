"""Shapes and types of what records hold and functions take, checked whenever a test makes or calls one: the annotations of
labsim's own sources are the claims (jaxtyping, beartype). Outside the tests nothing is checked.

jaxtyping's import hook does the same, but binds the shapes of every call too, and no function states any: the tests that fit
most took three times as long with it.
"""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import pkgutil
import sys
from functools import cached_property

from beartype import BeartypeConf, beartype
from jaxtyping import jaxtyped

CHECKED = (
    "labsim.records",
    "labsim.inference.fits.blocks",
    "labsim.inference.emulation.forward",
    "labsim.inference.observations",
)
# an int is a number where a float is asked for
check = beartype(conf=BeartypeConf(is_pep484_tower=True))


def check_shapes() -> None:
    """From now on, in all records and functions of these modules and of the modules within them."""
    modules = [importlib.import_module(name) for name in CHECKED]
    for module in list(modules):
        within = pkgutil.iter_modules(getattr(module, "__path__", ()), f"{module.__name__}.")
        modules += [importlib.import_module(found.name) for found in within]
    own = [each for module in modules for each in vars(module).values() if _is_of(each, module.__name__)]
    for each in filter(inspect.isclass, own):
        _check_class(each)
    checked = {each: check(each) for each in filter(inspect.isfunction, own)}
    # wherever they have been imported to
    for module in [each for name, each in sys.modules.items() if name.startswith("labsim")]:
        for name, each in list(vars(module).items()):
            if inspect.isfunction(each) and each in checked:
                setattr(module, name, checked[each])


def _is_of(each: object, name: str) -> bool:
    return getattr(each, "__module__", None) == name


def _check_class(each: type) -> None:
    """Its fields, if it is a record, with their shapes; what its methods and properties take and give."""
    if dataclasses.is_dataclass(each):
        jaxtyped(each, typechecker=check)
    if issubclass(each, tuple) or getattr(each, "_is_protocol", False):  # which have methods of their makers
        return
    for name, method in list(vars(each).items()):
        if inspect.isfunction(method) and not name.startswith("__"):
            setattr(each, name, check(method))
        elif isinstance(method, property):
            setattr(each, name, property(check(method.fget)))
        elif isinstance(method, cached_property):
            method.func = check(method.func)
