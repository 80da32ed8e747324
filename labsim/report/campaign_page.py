"""report.html of a diagnosed campaign: one file, no network, light and dark, printable."""

from __future__ import annotations

import base64
import math
from pathlib import Path

import jinja2

from ..diagnosis.campaign import Diagnosis
from ..diagnosis.next_experiment import Suggestion
from ..sph import solver_hash
from .campaign_tables import say_verdict

PICTURES = {
    "drops.png": "Every drop: measured depth, the nominal and the extended simulation, and what each leaves.",
    "maps.png": "Every scan: filling factor measured, and measured minus simulated.",
    "causes.png": "Probabilities of the causes.",
    "held_out.png": "Held-out drops: what the nominal and the extended model miss of a drop that no fit has seen.",
    "corner.png": "Posterior of the extended model.",
}

PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>{{ name }}: what the simulation gets wrong</title>
<style>
:root { color-scheme: light dark; --ink: #222; --soft: #666; --line: #ddd; --page: #fff }
@media (prefers-color-scheme: dark) { :root { --ink: #e8e8e8; --soft: #aaa; --line: #444; --page: #181818 }
 img { background: #fff } }
body { font: 16px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--page); max-width: 66rem; margin: 2rem auto;
 padding: 0 1rem }
h1 { font-size: 1.5rem } h2 { font-size: 1.15rem; margin-top: 2.2rem } .lead { font-size: 1.15rem }
.wide { overflow-x: auto } table { border-collapse: collapse; width: 100% }
th, td { text-align: left; padding: .3rem .7rem; border-bottom: 1px solid var(--line) }
td.number { text-align: right; font-variant-numeric: tabular-nums }
figure { margin: 1.2rem 0 } img { max-width: 100%; height: auto } figcaption, small { color: var(--soft) }
@media print { body { max-width: none; font-size: 11px } figure { break-inside: avoid } }
</style></head><body>
<main>
<h1>{{ name }}: what the simulation gets wrong</h1>
<p class="lead">{{ sentence }}</p>
<h2>What was measured</h2>
<p>{{ drops }} drops and {{ scans }} scans; {{ points }} data enter the likelihood. {{ description }}</p>
<p>Calibration of the nominal model: p_m = {{ "%.3f"|format(nominal) }} kPa; it explains the data with p = {{ "%.2g"|format(p) }}.
Scatter of ln p_m from sample to sample: {{ "%.3f ± %.3f"|format(scatter[0], scatter[1]) }}.</p>
<h2>Causes</h2>
<div class="wide"><table><tr><th>cause</th><th>probability</th><th>parameters (90 %)</th></tr>
{% for cause in causes %}<tr><td>{{ cause.causes|join(" + ") }}</td><td class="number">{{ "%.3f"|format(cause.probability) }}</td>
<td>{% for key, q in cause.parameters.items() %}{{ key }} = {{ "%.4g"|format(q.q50) }} ({{ "%.4g"|format(q.q05) }} to
{{ "%.4g"|format(q.q95) }}) {{ q.unit }}<br>{% endfor %}</td></tr>{% endfor %}</table></div>
{% if confusable %}<h2>What this campaign can hardly tell apart</h2>
<ul>{% for a, b, c in confusable %}<li>{{ a }} and {{ b }} (cosine {{ "%+.2f"|format(c) }})</li>{% endfor %}</ul>{% endif %}
<h2>Gain on held-out drops</h2>
<p>Each drop was predicted once from the others: rms {{ "%.1f"|format(gain.rms_nominal_m * 1e6) }} µm nominal,
{{ "%.1f"|format(gain.rms_extended_m * 1e6) }} µm extended, {{ "%.1f"|format(gain.rms_noise_m * 1e6) }} µm expected of a true
model; ln score {{ "%+.1f ± %.1f"|format(gain.log_score_difference, gain.log_score_difference_sigma) }};
{{ "%.0f"|format(100 * gain.fraction_of_discrepancy_removed) }} % of the removable discrepancy is gone.</p>
{% if suggestions %}<h2>Next experiment</h2><ol>{% for s in suggestions %}<li>{{ s.change }}: {{ s.information_bits }} bits</li>
{% endfor %}</ol>{% endif %}
<h2>Pictures</h2>
{% for source, text in pictures %}<figure><img alt="{{ text }}" src="data:image/png;base64,{{ source }}">
<figcaption>{{ text }}</figcaption></figure>
{% endfor %}
{% if warnings %}<h2>Warnings</h2><ul>{% for warning in warnings %}<li>{{ warning }}</li>{% endfor %}</ul>{% endif %}
<h2>How it was made</h2>
<p><small>Numerical error of the depth {{ "%.2g"|format(100 * numerical.depth_relative) }} % at a spacing of
{{ "%.3g"|format(numerical.spacing_m * 1e6) }} µm; {{ new }} new runs, {{ reused }} from the store; solver {{ solver }};
{{ "%.0f"|format(wall) }} s.</small></p>
</main></body></html>
"""


def write_campaign_page(found: Diagnosis, summary: dict, suggestions: list[Suggestion], folder: Path) -> Path:
    """report.html from a diagnosis, its summary and the pictures in the folder."""
    pictures = [
        (base64.b64encode((folder / name).read_bytes()).decode(), text)
        for name, text in PICTURES.items()
        if (folder / name).is_file()
    ]
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    text = environment.from_string(PAGE).render(
        name=found.campaign.name,
        description=found.campaign.description,
        sentence=say_verdict(found),
        drops=len(found.bench.models),
        scans=len(found.bench.scans),
        points=found.nominal.points,
        nominal=math.exp(found.nominal.log_p_m) / 1e3,
        p=found.p_value,
        scatter=found.scatter,
        causes=[cause for cause in summary["causes"] if cause["probability"] > 1e-3],
        confusable=found.confusable,
        gain=summary["gain"],
        suggestions=suggestions,
        pictures=pictures,
        warnings=found.warnings,
        numerical=summary["numerical_error"],
        new=found.runs_new,
        reused=found.runs_reused,
        solver=solver_hash(),
        wall=found.wall,
    )
    path = folder / "report.html"
    path.write_text(text, encoding="utf-8")
    return path
