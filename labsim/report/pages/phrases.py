"""Small pieces of the sentences of a page: numbers, lists, units."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ...diagnosis.gain import Gain
from ...diagnosis.untestable import Combination
from ...effects import Parameter

SHOWN = {"Pa": (1e-3, "kPa"), "m": (1e3, "mm"), "1/m": (1e-3, "1/mm"), "1": (1.0, "")}  # to what people see

SUPERSCRIPT = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")

SAID = {"none": "the nominal model", "unknown": "no listed cause"}
CERTAIN = 0.95  # probability of a cause from which p_m beside another is not worth a word


def shown_unit(parameter: Parameter) -> tuple[float, str]:
    return SHOWN.get(parameter.unit, (1.0, parameter.unit))


def say_amount(parameter: Parameter, value: float) -> str:
    """Three digits of a value (SI), in the unit that people use; of a pure number no unit."""
    factor, unit = shown_unit(parameter)
    return f"{value * factor:.3g} {unit}".rstrip()


def say_interval(middle: float, low: float, high: float) -> tuple[str, str, str]:
    """A value and the ends of its interval, with the decimals that the interval's width asks for: two of its own digits, six in
    all at most."""
    largest, width = max(abs(low), abs(middle), abs(high)), high - low
    if not (math.isfinite(largest) and 1e-4 <= largest < 1e6):
        return f"{middle:.3g}", f"{low:.3g}", f"{high:.3g}"
    order = math.floor(math.log10(largest))
    digits = 3 if width <= 0.0 else min(max(2, order - math.floor(math.log10(width)) + 2), 6)
    decimals = max(0, digits - 1 - order)
    return f"{middle:.{decimals}f}", f"{low:.{decimals}f}", f"{high:.{decimals}f}"


def say_hypothesis(hypothesis: Sequence[str]) -> str:
    """Names of effects as words, ``pixel scale + crust``, and what stands for none of them."""
    return " + ".join(SAID.get(name, name.replace("_", " ")) for name in hypothesis)


def add_article(label: str) -> str:
    return "the nominal model" if label == "nominal" else label


def say_combination(found: Combination) -> str:
    """p_m * shear_strength.factor^0.35 = 1.3 ± 0.06 kPa."""
    value = found.value / 1e3
    return f"{found.expression} = {value:.3g} ± {value * found.sigma:.2g} kPa"


def say_probability(value: float) -> str:
    """Two digits; what would round to one is above 0.99."""
    return f"{value:.2f}" if value < 0.995 else "above 0.99"


def say_p_value(value: float) -> str:
    """0.31, 4·10⁻⁵, > 0.99, < 10⁻⁶ (how far below, no reader needs); a dash where there is none."""
    if not math.isfinite(value):
        return "–"
    if value > 0.99:
        return "> 0.99"
    if value >= 1e-3:
        return f"{value:.2g}"
    if value < 1e-6:
        return "< 10⁻⁶"
    mantissa, exponent = f"{value:.0e}".split("e")
    return f"{mantissa}·10⁻{str(-int(exponent)).translate(SUPERSCRIPT)}"


def state_p_value(value: float) -> str:
    """p = 0.31, p < 10⁻⁶."""
    said = say_p_value(value)
    return f"p {said}" if said[0] in "<>" else f"p = {said}"


def tile_gain(gain: Gain, records: str) -> tuple[str, str, str]:
    """Tile of a page: what the extension removes on held-out records, or that there was nothing to remove."""
    if gain.rms_nominal <= gain.rms_noise:
        return f"held-out {records}", "met without it", "nothing to remove: within the noise"
    return (
        f"gone on held-out {records}",
        f"{100 * gain.fraction_removed:.0f} %" if math.isfinite(gain.fraction_removed) else "–",
        "of the removable discrepancy",
    )


def say_count(number: int, noun: str) -> str:
    return f"{number or 'no'} {noun}{'' if number == 1 else 's'}"


def list_names(names: Sequence[str]) -> str:
    return ", ".join(names)


def say_range(values: Sequence[float], form: str) -> str:
    if not values:
        return "–"
    low, high = form.format(min(values)), form.format(max(values))
    return low if low == high else f"{low} to {high}"
