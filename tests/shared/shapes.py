"""Shapes and types of what records hold, checked whenever a test makes one: the annotations of labsim's own sources are the
claims (jaxtyping, beartype). Outside the tests nothing is checked."""

from __future__ import annotations

from beartype import BeartypeConf, beartype
from jaxtyping import install_import_hook

CHECKED = (
    "labsim.records",
    "labsim.inference.fits.blocks",
    "labsim.inference.emulation.forward",
    "labsim.inference.observations",
)
# an int is a number where a float is asked for
check = beartype(conf=BeartypeConf(is_pep484_tower=True))


def check_shapes() -> None:
    """From now on, in modules that are not imported yet."""
    install_import_hook(CHECKED, "shapes.check")
