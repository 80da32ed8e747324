"""Shapes and types of what records hold, checked whenever a test makes one: the annotations of labsim's own sources are the
claims (jaxtyping, beartype). Outside the tests nothing is checked.

jaxtyping's own import hook makes the check of a record anew for every record, and checks every call of every function beside:
the tests that fit most took four times as long with it.
"""

from __future__ import annotations

import dataclasses
import functools
import importlib
import inspect
import pkgutil
from collections.abc import Callable
from types import ModuleType
from typing import Any, get_type_hints

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
    """From now on, in every record of these modules and of the modules within them."""
    for name in CHECKED:
        module = importlib.import_module(name)
        within = pkgutil.iter_modules(getattr(module, "__path__", ()), f"{name}.")
        for each in (module, *(importlib.import_module(found.name) for found in within)):
            _check_records(each)


def _check_records(module: ModuleType) -> None:
    for record in vars(module).values():
        if (
            inspect.isclass(record)
            and record.__module__ == module.__name__
            and dataclasses.is_dataclass(record)
        ):
            record.__init__ = _check_after(record.__init__, _check_fields(record))


def _check_fields(record: type) -> Callable[..., None]:
    """A function that takes the fields of a record and raises where they are not what its annotations say."""
    hints = get_type_hints(record)
    names = [field.name for field in dataclasses.fields(record)]
    space: dict[str, Any] = {}
    exec(f"def fields({', '.join(names)}): pass", space)
    fields = space["fields"]
    fields.__module__, fields.__name__, fields.__qualname__ = (
        record.__module__,
        record.__name__,
        record.__qualname__,
    )
    fields.__annotations__ = {name: hints[name] for name in names}
    return jaxtyped(fields, typechecker=check)


def _check_after(init: Callable[..., None], fields: Callable[..., None]) -> Callable[..., None]:
    @functools.wraps(init)
    def checked(self: Any, *args: Any, **options: Any) -> None:
        init(self, *args, **options)
        fields(**{field.name: getattr(self, field.name) for field in dataclasses.fields(self)})

    return checked
