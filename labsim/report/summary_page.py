"""report.html of published figures: one file with everything in it, readable without labsim or a network."""

from __future__ import annotations

import base64
from pathlib import Path

import jinja2

from ..diagnosis.summary import SummaryDiagnosis
from .tables import calibration_lines, value_text, verdict_text

PICTURES = {
    "penetration.png": "Raw penetration against time for five p_m, and the two published figures.",
    "depth_law.png": "Penetration depth against m v/A: the published law and the calibrated simulation.",
    "compacted_volume.png": "Dust compacted beyond a filling factor, and the published statement.",
    "density_field.png": "Filling factor under the projectile at the stop.",
    "fit.png": "Depth and stopping time against p_m, and p_m from every reading of the figures.",
    "corner.png": "Posterior of p_m, and of the depth and stopping time that go with it.",
}

PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{{ name }}: what the simulation gets wrong</title>
<style>
body { font: 16px/1.5 system-ui, sans-serif; color: #222; max-width: 62rem; margin: 2rem auto; padding: 0 1rem }
h1 { font-size: 1.5rem } h2 { font-size: 1.15rem; margin-top: 2.2rem }
table { border-collapse: collapse; width: 100% } th, td { text-align: left; padding: .3rem .7rem; border-bottom: 1px solid #ddd }
td.number { text-align: right; font-variant-numeric: tabular-nums } .missed { color: #D55E00; font-weight: 600 }
figure { margin: 1.2rem 0 } img { max-width: 100% } figcaption { color: #555 }
pre { background: #f5f5f5; padding: .8rem; overflow-x: auto; font-size: .82rem } .lead { font-size: 1.1rem }
</style></head><body>
<h1>{{ name }}: what the simulation gets wrong</h1>
<p class="lead">{{ sentence }}</p>
<p>{{ verdict }}</p>
<h2>Figures that were predicted</h2>
<table><tr><th>figure</th><th>published</th><th>simulation</th><th>deviation</th><th></th></tr>
{% for row in rows %}<tr><td>{{ row.name }}{% if row.note %} <small>({{ row.note }})</small>{% endif %}</td>
<td class="number">{{ value(row, "observed") }}</td><td class="number">{{ value(row, "predicted") }}</td>
<td class="number">{{ "%+.1f σ"|format(row.deviation) }}</td>
<td>{% if row.used %}calibrated on{% elif row.missed %}<span class="missed">missed</span>{% else %}kept{% endif %}</td></tr>
{% endfor %}</table>
<h2>Pictures</h2>
{% for source, text in pictures %}<figure><img alt="{{ text }}" src="data:image/png;base64,{{ source }}">
<figcaption>{{ text }}</figcaption></figure>
{% endfor %}
<h2>Calibration</h2>
<pre>{{ calibration }}</pre>
{% if warnings %}<h2>Warnings</h2><ul>{% for warning in warnings %}<li>{{ warning }}</li>{% endfor %}</ul>{% endif %}
{% if assumed %}<h2>What was assumed</h2>
<ul>{% for key, text in assumed %}<li>{{ key }}: {{ text }}</li>{% endfor %}</ul>{% endif %}
</body></html>
"""


def write_page(diagnosis: SummaryDiagnosis, folder: Path) -> Path:
    """report.html from a diagnosis and the pictures that lie in the folder."""
    campaign = diagnosis.calibration.campaign
    pictures = [
        (base64.b64encode((folder / name).read_bytes()).decode(), text)
        for name, text in PICTURES.items()
        if (folder / name).is_file()
    ]
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    text = environment.from_string(PAGE).render(
        name=campaign.name,
        sentence=diagnosis.sentence,
        verdict=verdict_text(diagnosis),
        rows=diagnosis.predictions,
        value=value_text,
        pictures=pictures,
        calibration=calibration_lines(diagnosis.calibration),
        warnings=diagnosis.warnings,
        assumed=list(campaign.source.items()),
    )
    path = folder / "report.html"
    path.write_text(text, encoding="utf-8")
    return path
