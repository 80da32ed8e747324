"""What to do about a verdict: the effect's own words, or what its kind asks for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...diagnosis.campaign import Diagnosis
from ...diagnosis.next_experiment import Suggestion
from .phrases import say_hypothesis

KEEP = "keep it in the model: labsim simulate --model model.toml"
CHECK = ". Another measurement of the material would check it, such as a static strength test"
BY_KIND = {
    "material": KEEP,
    "sample": f"prepare the sample anew, or {KEEP}",
    "contact": KEEP,
    "projectile": KEEP,
    "measurement": "measure it again, and write what you find",
    "numerics": "simulate with more spacings in the tip radius",
}


def say_remedy(found: Diagnosis, suggestions: Sequence[Suggestion]) -> str:
    """What to do, in sentences."""
    if found.verdict.word == "none":
        return "Nothing needs to be mended."
    if found.verdict.word == "unknown":
        if found.learned is not None:
            return (
                "labsim simulate --model model.toml simulates the formula; labsim effects CAMPAIGN --from with this folder lets "
                "the next campaign try it by name."
            )
        if found.unknown.find_wobble(found.nominal) is not None:
            return "Mount the camera apart from what shakes, or film a mark at rest too and take its motion off the rows."
        return "Look where the nominal fit misses the data, and make the experiment that is proposed next."
    said = []
    if len(found.verdict.named) > 1 and suggestions:
        best = suggestions[0]
        pair = best.tells or [hypothesis for hypothesis, _ in found.verdict.named[:2]]
        further = [name for name in pair[1] if name not in pair[0]]
        if set(pair[0]) < set(pair[1]):  # the first is at work either way
            said.append(f"to tell whether {say_hypothesis(further)} is at work too: {best.change}")
        else:
            said.append(f"first tell {' from '.join(map(say_hypothesis, pair))}: {best.change}")
    for name in found.verdict.probabilities[0][0]:
        effect = found.problem.effects[name]
        value = 0.0
        if effect.amplitudes:
            parameter = f"{name}.{effect.amplitudes[0].name}"
            value = float(np.median(found.posterior_extended.samples(parameter)))
        advice = effect.remedy.format(value=value) if effect.remedy else BY_KIND[effect.kind]
        untested = effect.kind == "material" and not effect.remedy and not found.campaign.strength_tests
        said.append(advice + CHECK * untested)
    return " ".join(f"{text[0].upper()}{text[1:]}." for text in dict.fromkeys(said))
