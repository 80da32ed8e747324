"""Every public name says what it takes, what it gives and what it raises, in the sections of numpydoc."""

from __future__ import annotations

import inspect
import re
from itertools import pairwise

import pytest

import labsim

NAMES = [name for name in labsim.__all__ if callable(getattr(labsim, name))]


def sections(text: str) -> set[str]:
    lines = text.splitlines()
    return {
        title
        for title, below in pairwise(lines)
        if below and set(below) == {"-"} and len(below) == len(title)
    }


@pytest.mark.parametrize("name", NAMES)
def test_every_public_name_has_its_sections(name: str) -> None:
    thing = getattr(labsim, name)
    found = sections(inspect.getdoc(thing) or "")
    assert "Parameters" in found, found
    if inspect.isfunction(thing):
        assert "Returns" in found, found


@pytest.mark.parametrize("name", NAMES)
def test_every_parameter_is_explained(name: str) -> None:
    thing = getattr(labsim, name)
    text = inspect.getdoc(thing) or ""
    words = text.split("Parameters\n----------\n")[1].split("\n\n")[0]
    for parameter in inspect.signature(thing).parameters:
        assert parameter in words, parameter


@pytest.mark.parametrize("name", NAMES)
def test_no_public_name_takes_or_gives_just_anything(name: str) -> None:
    signature = inspect.signature(getattr(labsim, name))
    annotations = [parameter.annotation for parameter in signature.parameters.values()]
    assert not [
        each for each in [*annotations, signature.return_annotation] if re.search(r"\bAny\b", str(each))
    ]
