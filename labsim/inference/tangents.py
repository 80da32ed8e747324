"""All parts of the data about one point of the globals, by finite differences of what the workbench predicts there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from .blocks import Block
from .drop_model import DropModel
from .drop_terms import Probe
from .likelihood import Linearised, linearise
from .scans import linearise_scan
from .undisturbed import Seen, linearise_undisturbed
from .workbench import Workbench


def linearise_at(
    bench: Workbench,
    models: list[DropModel],
    scan_speeds: Sequence[float],
    log_p_m: float,
    values: Mapping[str, float],
    further: Sequence[str] = (),
) -> Linearised:
    probes = {}
    for name, amplitude in {**{name: 0.0 for name in further}, **values}.items():
        step = 0.05 * bench.effects[name].amplitudes[0].step
        parameter = bench.effects[name].amplitudes[0]
        low, high = parameter.limits
        if not low <= parameter.null + amplitude + step <= high:
            step = -step
        probes[name] = _stand(bench, {**values, name: amplitude + step}, step)
    nominal = _stand(bench, values)
    linear = linearise(models, log_p_m, nominal, bench.terms, probes)
    scans = tuple(
        linearise_scan(scan, speed, log_p_m, nominal, bench.terms, probes)
        for scan, speed in zip(bench.scans, scan_speeds, strict=True)
    )
    return replace(linear, scans=scans, undisturbed=tuple(_linearise_dust(bench, nominal, probes)))


def _stand(bench: Workbench, values: Mapping[str, float], step: float = 0.0) -> Probe:
    return Probe(values, bench.instruments(values), bench.log_offsets(values), step)


def linearise_dust(bench: Workbench, values: Mapping[str, float], steps: Mapping[str, float]) -> list[Block]:
    """The undisturbed dust about amplitudes, with tangents by the given steps; empty without scans."""
    probes = {
        name: _stand(bench, {**values, name: values.get(name, 0.0) + step}, step)
        for name, step in steps.items()
    }
    return _linearise_dust(bench, _stand(bench, values), probes)


def _linearise_dust(bench: Workbench, nominal: Probe, probes: Mapping[str, Probe]) -> list[Block]:
    if not bench.undisturbed:
        return []
    plain = bench.grid.setting(bench.families[0], bench.families[0].speeds[0], 1000.0)

    def see(point: Probe) -> dict[str, Seen]:
        seen = {}
        for dust in bench.undisturbed:
            setting = plain
            for name, amplitude in point.amplitudes.items():
                if amplitude != 0.0:
                    place = bench.places[dust.name]
                    setting = bench.effects[name].apply(setting, bench.at(name, amplitude), place)
            seen[dust.name] = (setting, point.instruments[dust.name])
        return seen

    moved = {name: (see(point), point.step) for name, point in probes.items()}
    sigma = bench.campaign.sample.filling_factor_sigma
    return [linearise_undisturbed(bench.undisturbed, see(nominal), moved, sigma)]
