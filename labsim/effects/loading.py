"""Effects are found by listing a folder and checked when loaded; whatever breaks the contract is named with its file.

The catalogue is ``labsim/effects/catalogue``; a campaign's own effects lie in ``CAMPAIGN/effects`` and follow the same
contract. Their code is run as it is, and each file is named before it is: take campaigns only from people you trust.
"""

from __future__ import annotations

import inspect
import math
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

from ..errors import EffectError
from ..extensions import announce_code, list_files
from ..records import (
    STANDARD_GRAVITY,
    Camera,
    Campaign,
    Drop,
    GreyCalibration,
    Material,
    Measured,
    Projectile,
    Record,
    Sample,
    Scan,
)
from ..sph.materials import list_numbers
from .contract import KINDS, OBSERVABLES, Effect, Parameter
from .priors import Prior

CATALOGUE = Path(__file__).parent / "catalogue"
_loaded: dict[tuple[Path, int], Effect] = {}


def list_effects(campaign: Campaign | Path | str | None = None) -> dict[str, Effect]:
    """All effects by name: the catalogue, and a campaign's own.

    campaign: a Campaign (parameters resolved for it), a campaign folder (its files join; parameters of the reference
    laboratory) or None (the catalogue, ditto). Raises EffectError naming the file that breaks the contract.
    """
    files = _list_files(CATALOGUE)
    files |= list_files("labsim.effects", files)
    folder = campaign.folder if isinstance(campaign, Campaign) else Path(campaign) if campaign else None
    if folder is not None:
        for name, file in list_own_files(folder).items():
            if name in files:
                raise EffectError(
                    file, "", f"{name} is the name of an effect of the catalogue; rename the file"
                )
            files[name] = file
    effects = {name: load_file(file) for name, file in files.items()}
    if isinstance(campaign, Campaign):
        return {name: effect.for_campaign(campaign) for name, effect in effects.items()}
    return effects


def list_own_files(folder: Path | str) -> dict[str, Path]:
    """The effects that a campaign brings along, by name; none of them is run. Raises EffectError for a name that cannot be."""
    return _list_files(Path(folder) / "effects")


def load_effect(name: str, campaign: Campaign | Path | str | None = None) -> Effect:
    """One effect by name. Raises EffectError."""
    effects = list_effects(campaign)
    if name not in effects:
        raise EffectError("effects", name, f"is not an effect; use one of {', '.join(effects)}")
    return effects[name]


def load_file(file: Path) -> Effect:
    """Load and check one effect file. Raises EffectError naming the file, the name in it and what would be right."""
    file = Path(file).resolve()
    try:
        source = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as trouble:
        raise EffectError(file, "", f"cannot be read ({trouble}); save it as UTF-8 text") from None
    key = (file, hash(source))
    if key not in _loaded:
        if file.parent != CATALOGUE.resolve():
            announce_code(file)
        _loaded[key] = _check(file, _run(file, source))
    return _loaded[key]


def reference_campaign() -> Campaign:
    """The laboratory whose nulls are shown where no campaign is given: 1 and 3 mm rods into dust of filling factor 0.15."""
    sample = Sample(0.15, 0.001, 2000.0, 0.025, 0.020, 10.0)
    camera = Camera(1.0e4, 2.0e-5, 200.0, 0.2)
    drops = []
    for number, (radius, mass, height) in enumerate(
        ((5e-4, 1.33e-6, 2e-3), (5e-4, 1.33e-6, 20e-3), (5e-4, 1.33e-6, 70e-3), (1.5e-3, 3.59e-5, 30e-3)),
        start=1,
    ):
        rod = Projectile("hemisphere", radius, mass, 0.005 * mass, 8 * radius)
        record = Record("track", Path("track.csv"), 0.08)
        drops.append(Drop(f"D{number:02d}", rod, number, Measured(height, 1.5e-4), camera, record))
    bead = Projectile("sphere", 5e-4, 1.33e-6)
    grey = GreyCalibration(12.0, 0.16, 2000.0)
    scan = Scan("C01", bead, Measured(0.8, 0.04), Path("slices"), 4.0e-5, "top", 8, grey)
    return Campaign(
        folder=Path("reference"),
        name="reference",
        description="the laboratory that the catalogue's numbers are shown for",
        sample=sample,
        material=Material(),
        p_m_range=(300.0, 6000.0),
        gravity=STANDARD_GRAVITY,
        geometry="axisymmetric",
        drops=tuple(drops),
        scans=(scan,),
    )


def _list_files(folder: Path) -> dict[str, Path]:
    if not folder.is_dir():
        return {}
    files = sorted(file for file in folder.glob("*.py") if not file.name.startswith("_"))
    for file in files:
        if not file.is_file():
            raise EffectError(file, "", "is a folder or a device, not a file; remove it or rename it")
        if not file.stem.isidentifier() or file.stem != file.stem.lower():
            raise EffectError(
                file, "", f"{file.stem!r} cannot be an effect's name; use lower case, digits and _"
            )
    return {file.stem: file for file in files}


def _run(file: Path, source: str) -> types.ModuleType:
    """The file as a module. Run from its text, so that nothing is written beside it."""
    catalogue = file.parent == CATALOGUE.resolve()
    package = "labsim.effects.catalogue" if catalogue else "labsim_campaign_effects"
    module = types.ModuleType(f"{package}.{file.stem}")
    module.__file__ = str(file)
    if catalogue:
        module.__package__ = package
    try:
        exec(compile(source, str(file), "exec"), module.__dict__)
    except SyntaxError as trouble:
        raise EffectError(
            file, f"line {trouble.lineno}", f"is not Python ({trouble.msg}); correct that line"
        ) from None
    except EffectError:
        raise
    except Exception as trouble:
        raise EffectError(
            file, "", f"cannot be loaded ({type(trouble).__name__}: {trouble}); correct the file"
        ) from trouble
    return module


def _check(file: Path, module: types.ModuleType) -> Effect:
    def text(name: str) -> str:
        value = getattr(module, name, None)
        if not isinstance(value, str) or not value.strip():
            raise EffectError(
                file, name, f'{"is missing" if value is None else repr(value)}; write {name} = "..."'
            )
        return value

    kind = text("kind")
    if kind not in KINDS:
        raise EffectError(file, "kind", f"{kind!r} is not known; write one of {', '.join(KINDS)}")
    references = getattr(module, "references", None)
    if not isinstance(references, tuple) or not all(
        isinstance(each, str) and each.strip() for each in references
    ):
        raise EffectError(
            file, "references", f'{references!r} is not a tuple of texts; write references = ("...",)'
        )
    expect = getattr(module, "expect", None)
    if not isinstance(expect, dict) or not all(
        key in OBSERVABLES and sign in (-1, 0, 1) and not isinstance(sign, bool)
        for key, sign in expect.items()
    ):
        raise EffectError(
            file,
            "expect",
            f"{expect!r} is not a dict from {', '.join(OBSERVABLES)} to -1, 0 or 1 (the sign of the change)",
        )
    if not hasattr(module, "parameters"):
        raise EffectError(
            file, "parameters", "is missing; write a tuple of Parameter or a function of the campaign"
        )
    setting = _function(file, module, "change_setting", 3)
    instrument = _function(file, module, "change_instrument", 3)
    if setting is None and instrument is None:
        raise EffectError(
            file, "change_setting", "is missing, and so is change_instrument; write at least one of them"
        )
    applies = _function(file, module, "applies", 1) or (lambda campaign: "")
    needs = getattr(module, "needs", ())
    if not isinstance(needs, tuple) or not all(isinstance(each, str) for each in needs):
        raise EffectError(file, "needs", f'{needs!r} is not a tuple of names; write needs = ("delta",)')
    remedy = getattr(module, "remedy", "")
    try:
        remedy.format(value=1.0)
    except (AttributeError, LookupError, ValueError):
        raise EffectError(
            file,
            "remedy",
            f"{remedy!r} is not a sentence; write text, in which {{value}} is the first parameter",
        ) from None

    without = getattr(module, "without", "")
    if not isinstance(without, str):
        raise EffectError(
            file,
            "without",
            f'{without!r} is not text; write how a drop is made without it, "in a deeper sample"',
        )
    says = getattr(module, "says", None)
    if says is not None and not (
        isinstance(says, tuple)
        and len(says) == 2
        and all(isinstance(each, str) and each.strip() for each in says)
    ):
        raise EffectError(
            file,
            "says",
            f"{says!r} is not two titles; write what is wrong below the first parameter's null, and above it",
        )

    def reason_against(campaign: Campaign) -> str:
        law = campaign.material.law
        missing = [name for name in needs if name not in list_numbers(law)]
        if missing:
            return f"the law {Path(law).stem} has no {' and no '.join(missing)}"
        reason = applies(campaign)
        if not isinstance(reason, str):
            raise EffectError(file, "applies", f'returned {reason!r}; return "" or the reason why not')
        return reason

    def resolve(campaign: Campaign) -> tuple[Parameter, ...]:
        return _check_parameters(file, module, campaign)

    return Effect(
        name=file.stem,
        title=text("title"),
        kind=kind,
        parameters=resolve(reference_campaign()),
        leaves=text("leaves"),
        references=references,
        expect=expect,
        file=file,
        reason_against=reason_against,
        change_setting=setting,
        change_instrument=instrument,
        resolve=resolve,
        description=inspect.cleandoc(module.__doc__ or ""),
        remedy=remedy,
        without=without,
        says=says,
        reshape=_function(file, module, "reshape", 2),
        narrow=_function(file, module, "narrow", 2),
    )


def _function(file: Path, module: types.ModuleType, name: str, count: int) -> Callable[..., Any] | None:
    function = getattr(module, name, None)
    if function is None:
        return None
    if not callable(function):
        raise EffectError(file, name, f"{function!r} is not a function; write def {name}(...)")
    try:
        inspect.signature(function).bind(*range(count))
    except TypeError:
        names = ("campaign",), ("parameter", "value"), (name.removeprefix("change_"), "values", "place")
        wanted = f"({', '.join(names[count - 1])})"
        raise EffectError(file, name, f"does not take {count} arguments; write def {name}{wanted}") from None
    return function


def _check_parameters(file: Path, module: types.ModuleType, campaign: Campaign) -> tuple[Parameter, ...]:
    stated = module.parameters
    if callable(stated):
        try:
            stated = stated(campaign)
        except Exception as trouble:
            raise EffectError(
                file,
                "parameters",
                f"failed for {campaign.name} ({type(trouble).__name__}: {trouble}); correct the function",
            ) from trouble
    if not isinstance(stated, tuple) or not all(isinstance(each, Parameter) for each in stated):
        raise EffectError(file, "parameters", f"{stated!r} is not a tuple of Parameter")
    seen: set[str] = set()
    for parameter in stated:
        key = f"parameters.{parameter.name}"

        def refuse(message: str, key: str = key) -> None:
            raise EffectError(file, key, message)

        if not isinstance(parameter.name, str) or not parameter.name.isidentifier() or parameter.name in seen:
            refuse("needs a name of letters, digits and _ that no other parameter has")
        seen.add(parameter.name)
        if not isinstance(parameter.unit, str) or not parameter.unit:
            refuse(f'unit {parameter.unit!r} is not a text; write "1" for a pure number')
        if not isinstance(parameter.text, str) or not parameter.text.strip():
            refuse("text is empty; say what the parameter is and why its prior is this wide")
        try:
            low, high = map(float, parameter.limits)
            null, step = float(parameter.null), float(parameter.step)
        except (TypeError, ValueError):
            refuse(
                f"null {parameter.null!r}, limits {parameter.limits!r} and step {parameter.step!r} must be numbers"
            )
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            refuse(f"limits {parameter.limits!r} must be finite and grow")
        if not low <= null <= high:
            refuse(f"null {null:g} lies outside the limits {low:g} to {high:g}")
        if not (math.isfinite(step) and step != 0.0):
            refuse(f"step {step!r} must be a finite number other than 0")
        if not low <= null + step <= high:
            refuse(
                f"null + step = {null + step:g} lies outside the limits {low:g} to {high:g}; shorten or turn the step"
            )
        if not isinstance(parameter.prior, Prior):
            *names, last = (law.__name__ for law in get_args(Prior))
            refuse(f"prior {parameter.prior!r} is not {', '.join(names)} or {last}")
        if not parameter.prior.sd > 0.0:
            refuse(f"prior {parameter.prior!r} needs a positive width")
        if not float(parameter.prior.cdf(high) - parameter.prior.cdf(low)) > 1e-6:
            refuse(f"prior {parameter.prior!r} leaves nothing between the limits {low:g} and {high:g}")
    if stated and all(parameter.shape for parameter in stated):
        raise EffectError(file, "parameters", "are all shape; one must switch the effect off at its null")
    return stated
