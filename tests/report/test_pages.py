"""What stands on the pages: every section, every number of the JSON beside it, nothing that runs or is fetched."""

from __future__ import annotations

import base64
import dataclasses
import hashlib
import html
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from labsim import __version__
from labsim.diagnosis.next_experiment import Suggestion
from labsim.diagnosis.planned_drops import DropPrediction
from labsim.diagnosis.unlisted.learned_law import Formula, LearnedLaw
from labsim.effects.terms import list_terms
from labsim.report.figures.interactive import SIGNS, SYMBOLS
from labsim.report.outputs import write_result
from labsim.report.pages.phrases import say_interval, say_p_value, say_probability
from labsim.sph import solver_hash

SECTIONS = "measurement calibration drops causes confusable gain next numerics warnings made".split()
HOSTILE = "<script>document.title='ran'</script>"


class Page(HTMLParser):
    """Elements, ids, links, pictures, scripts and the text that a reader sees."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict]] = []
        self.scripts: list[str] = []
        self.words: list[str] = []
        self._inside: list[str] = []
        self.source = path.read_text(encoding="utf-8")
        self.feed(self.source)

    def handle_starttag(self, tag, attrs):  # type: ignore[no-untyped-def]
        self.tags.append((tag, dict(attrs)))
        if tag in ("script", "style"):
            self._inside.append(tag)
            if tag == "script":
                self.scripts.append("")

    def handle_endtag(self, tag):  # type: ignore[no-untyped-def]
        if self._inside and self._inside[-1] == tag:
            self._inside.pop()

    def handle_data(self, data):  # type: ignore[no-untyped-def]
        if self._inside == ["script"]:
            self.scripts[-1] += data
        elif not self._inside:
            self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())

    def all(self, tag: str) -> list[dict]:
        return [attributes for name, attributes in self.tags if name == tag]

    @property
    def ids(self) -> list[str]:
        return [attributes["id"] for _, attributes in self.tags if "id" in attributes]


PAGES = ["none", "effect", "unknown", "calibrated", "published"]


@pytest.mark.parametrize("name", PAGES)
def test_one_file_that_asks_for_nothing(name: str, request: pytest.FixtureRequest) -> None:
    folder = request.getfixturevalue(name)
    page = Page(folder / "report.html")
    assert (folder / "report.html").stat().st_size < 8e6
    for tag, attributes in page.tags:
        for key in ("src", "href", "action", "data", "poster", "srcset"):
            if key in attributes and tag != "meta":
                assert attributes[key].startswith(("data:image/png;base64,", "#")), (
                    tag,
                    attributes[key][:60],
                )
    assert "@import" not in page.source[: page.source.index("</style>")] and not page.all("link")
    policy = next(a["content"] for a in page.all("meta") if a.get("http-equiv") == "Content-Security-Policy")
    assert "default-src 'none'" in policy and "unsafe-eval" not in policy
    assert "unsafe-inline" not in policy.split("script-src")[1]
    for attributes, text in zip(page.all("script"), page.scripts, strict=True):
        if attributes.get("type") != "application/json":
            digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
            assert f"'sha256-{digest}'" in policy


@pytest.mark.parametrize("name", PAGES)
def test_keyboard_and_text_alternatives(name: str, request: pytest.FixtureRequest) -> None:
    page = Page(request.getfixturevalue(name) / "report.html")
    ids = page.ids
    assert len(ids) == len(set(ids))
    links = [a["href"] for a in page.all("a")]
    assert links[0] == "#content", "the first thing that the tab key reaches skips to the content"
    assert all(link[1:] in ids for link in links)
    for picture in page.all("img"):
        assert len(picture["alt"]) > 20
    for attributes in page.all("div"):
        if "data-figure" in attributes:
            assert attributes["role"] == "figure" and len(attributes["aria-label"]) > 20
        if "tabindex" in attributes:
            assert attributes["aria-label"]
    assert page.all("html")[0]["lang"] == "en" and len(page.all("h1")) == 1


@pytest.mark.parametrize("name", ["none", "effect", "unknown"])
def test_every_section_in_order_with_its_numbers(name: str, request: pytest.FixtureRequest) -> None:
    folder = request.getfixturevalue(name)
    page = Page(folder / "report.html")
    diagnosis = json.loads((folder / "diagnosis.json").read_text())
    wanted = SECTIONS[:3] + (["maps"] if name == "unknown" else []) + SECTIONS[3:]
    assert [a["id"] for a in page.all("section")] == wanted
    assert diagnosis["verdict"] == name
    text = page.text
    assert f"{diagnosis['p_m_Pa']['nominal']['q50'] / 1e3:.3f}" in text
    assert f"{1e6 * diagnosis['gain']['rms_nominal_m']:.1f} µm" in text
    assert solver_hash() in text and __version__ in text
    for warning in diagnosis["warnings"]:
        assert warning in text
    best = diagnosis["causes"][0]
    assert f"{best['probability']:.3f}" in text
    for each in diagnosis["not_testable"]:
        low, high = (p / 1e3 for p in each["p_m_Pa"])
        assert each["cause"] in text and f"{low:.3g} to {high:.3g}" in text
    missed = [part["name"] for part in diagnosis["misfit"] if part["p_value"] < 0.05]
    assert ("The nominal fit misses" in text) == bool(missed) and all(name in text for name in missed)
    assert diagnosis["misfit"][0]["name"] == "drops"
    figures = json.loads(page.scripts[0])
    drawn = [a["data-figure"] for a in page.all("div") if "data-figure" in a]
    assert sorted(drawn) == sorted(figures), "every figure has its place and every place its figure"
    assert sum(f"drop-{k}" in page.ids for k in range(1, 7)) == 6
    if name == "effect":
        assert (
            "strength_rate" in text
            and f"{100 * diagnosis['gain']['fraction_of_discrepancy_removed']:.0f} %" in text
        )
        assert (
            len(figures["drop0"]["data"]) == 7
        )  # two bands, measured, and a curve and what it leaves for each model
    if name == "none":
        assert "Nothing is added to the model" in text and len(figures["drop0"]["data"]) == 5


def test_the_verdict_is_the_first_sentence(effect: Path) -> None:
    page = Page(effect / "report.html")
    text = page.text
    assert text.index("The simulation is wrong: ") < text.index("What was measured")


def test_a_hostile_name_stays_text(effect: Path) -> None:
    page = Page(effect / "report.html")
    assert HOSTILE in page.text
    assert (
        HOSTILE not in page.source and html.escape(HOSTILE, quote=False).replace("'", "&#39;") in page.source
    )
    assert len(page.scripts) == 3


def test_what_is_left_over_is_told(unknown: Path) -> None:
    text = Page(unknown / "report.html").text
    assert "No map could be made of C02" in text
    assert "it holds no bead & <b>nothing</b> else" in text
    assert "no listed cause explains" in text


def test_maps_stand_side_by_side_with_their_difference(unknown: Path) -> None:
    figures = json.loads(Page(unknown / "report.html").scripts[0])
    measured, simulated, left = (
        figures[name]["data"][0]["z"] for name in ("map0", "map0_simulated0", "map0_left0")
    )
    compared = 0
    for a_row, b_row, c_row in zip(measured, simulated, left, strict=True):
        for a, b, c in zip(a_row, b_row, c_row, strict=True):
            if b is not None:
                compared += 1
                assert c == pytest.approx(a - b, abs=2e-6)
    assert compared > 100


def test_bands_hold_what_a_true_model_leaves(effect_found) -> None:  # type: ignore[no-untyped-def]
    from labsim.report.pages.drop_views import view_drops

    views = view_drops(effect_found.problem, [("nominal", effect_found.nominal), ("true", effect_found.best)])
    assert any(view.stands_out("nominal") for view in views)
    assert not any(view.stands_out("true") for view in views)
    for view in views:
        assert (view.allowed >= view.noise).all()
        # noise alone cannot be beaten, nor may the band be so wide that it says nothing
        assert 0.5 * view.noise < view.rms("true") < 2 * view.allowed.max() < 0.1 * view.at_stop()


def test_the_extension_takes_the_discrepancy_out(effect_found) -> None:  # type: ignore[no-untyped-def]
    """On drops held out, where it is well above what noise leaves."""
    gain = effect_found.gain
    assert gain.rms_nominal > 2 * gain.rms_noise and gain.fraction_removed > 0.8


def test_an_experiment_between_formulas_is_on_the_page_in_the_lines_and_in_the_file(
    effect_found, tmp_path: Path
) -> None:  # type: ignore[no-untyped-def]
    terms = [list_terms()[name] for name in ("inertial_drag", "viscous_drag")]
    formulas = []
    for term, depth in zip(terms, (1.958e-3, 1.986e-3), strict=True):
        fit = SimpleNamespace(
            hypothesis=(term.name,), values={term.name: 500.0}, covariance=np.diag([0.05, 50.0]) ** 2, log_p_m=7.0,
            evidence=10.0 - 1e3 * depth,
        )  # fmt: skip
        formulas.append(Formula((term,), fit, None, None))
    predictions = tuple(
        (term.name, DropPrediction(np.zeros(1), np.eye(1), depth, 1.6e-5, 4.94e-3))
        for term, depth in zip(terms, (1.958e-3, 1.986e-3), strict=True)
    )
    tells = tuple((term.title,) for term in terms)
    found = dataclasses.replace(
        effect_found,
        learned=LearnedLaw(tuple(formulas), effect_found.problem, effect_found.gain),
        suggestions=(Suggestion("one more drop at 0.71 m/s", 3.3, tells, predictions),),
    )
    summary, lines = write_result(found, tmp_path)
    drags = "a drag that grows with the square of the speed", "a drag that grows with the speed"
    said = f"one more drop at 0.71 m/s, to tell {drags[0]} from {drags[1]}"
    assert f"next experiment: {said} (3.3 bits)" in lines
    assert "    viscous_drag expects 1.986 ± 0.016 mm in 4.94 ms" in lines
    (told,) = summary["next_experiment"]
    assert told["change"] == said
    assert [each["cause"] for each in told["predictions"]] == ["inertial_drag", "viscous_drag"]
    assert told["predictions"][0]["depth_mm"] == pytest.approx(1.958)
    text = Page(tmp_path / "report.html").text.replace("\u00a0", " ")
    assert f"What would tell the formulas that still stand apart ({drags[0]}; {drags[1]})" in text
    assert "one more drop at 0.71 m/s: 3.3 bits" in text
    assert "viscous drag: 1.986 ± 0.016 mm in 4.94 ms" in text


def test_a_single_drop_is_calibrated(calibrated: Path) -> None:
    page = Page(calibrated / "report.html")
    assert [a["id"] for a in page.all("section")] == [
        "measurement",
        "calibration",
        "drops",
        "numerics",
        "warnings",
        "made",
    ]
    calibration = json.loads((calibrated / "calibration.json").read_text())
    assert f"{calibration['p_m_Pa']['q50'] / 1e3:.3f} kPa" in page.text
    assert (calibrated / "fit.png").stat().st_size > 5000
    assert (calibrated / "posterior.png").stat().st_size > 5000
    assert not (calibrated / "corner.png").exists(), "p_m alone has no other parameter beside it"


def test_published_figures(published: Path) -> None:
    page = Page(published / "report.html")
    diagnosis = json.loads((published / "diagnosis.json").read_text())
    assert diagnosis["sentence"] in page.text and not page.scripts
    for row in diagnosis["predictions"]:
        assert row["figure"] in page.text
    assert len(page.all("img")) == 6


def test_inputs_are_hashed(effect: Path, effect_found) -> None:  # type: ignore[no-untyped-def]
    text = Page(effect / "report.html").text
    for name in ("campaign.toml", "drops/D01/track.csv"):
        digest = hashlib.sha256((effect_found.campaign.folder / name).read_bytes()).hexdigest()
        assert re.search(rf"{re.escape(name)} \d+ {digest}", text)


def test_a_figure_s_data_are_finite(effect: Path) -> None:
    data = Page(effect / "report.html").scripts[0]
    assert "NaN" not in data and "Infinity" not in data and "<" not in data


@pytest.mark.parametrize(
    ("value", "said"),
    [(0.31, "0.31"), (0.0021, "0.0021"), (3.6e-5, "4·10⁻⁵"), (9.6e-256, "< 10⁻⁶"), (1.0, "> 0.99"), (0.0, "< 10⁻⁶"),
     (float("nan"), "–")],
)  # fmt: skip
def test_p_values_as_people_write_them(value: float, said: str) -> None:
    assert say_p_value(value) == said


def test_no_probability_is_said_to_be_one() -> None:
    assert [say_probability(p) for p in (0.5, 0.994, 0.996, 1.0)] == [
        "0.50",
        "0.99",
        "above 0.99",
        "above 0.99",
    ]


def test_the_symbols_of_the_projectiles_are_named_above_the_figure(effect: Path) -> None:
    """A sign a projectile, in the order of the figure's symbols; no legend inside that could cover data on a narrow page."""
    page = Page(effect / "report.html")
    figures = json.loads(page.scripts[0])
    symbols = list(dict.fromkeys(trace["marker"]["symbol"] for trace in figures["misfit"]["data"]))
    signs = [SIGNS[SYMBOLS.index(symbol)] for symbol in symbols]
    places = [page.text.index(sign) for sign in signs]
    assert len(signs) >= 2 and places == sorted(places)
    for name in ("misfit", "p_m", "held_out"):
        assert figures[name]["layout"]["showlegend"] is False


def test_an_unknown_cause_claims_no_gain_at_the_top(unknown: Path) -> None:
    """The nearest listed cause is no answer: its p_m and gain stand further down, not beside the verdict."""
    text = Page(unknown / "report.html").text
    top = text[: text.index("What was measured")]
    assert "what is missing" in top and "gone on held-out drops" not in top and "p_m with" not in top


def test_numbers_stay_with_their_units(effect: Path) -> None:
    source = Page(effect / "report.html").source
    words = source[source.index("<main") : source.index("</main>")]
    assert "\u00a0±\u00a0" in words and " ± " not in words and " µm rms" not in words


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ((1.06014, 1.0562, 1.0641), ("1.0601", "1.0562", "1.0641")),
        ((0.31, 0.12, 0.52), ("0.31", "0.12", "0.52")),
        ((0.15, 0.15, 0.15), ("0.150", "0.150", "0.150")),
        ((0.1321, 0.1134, 0.15), ("0.132", "0.113", "0.150")),
        ((1352.4, 1281.3, 1460.0), ("1352", "1281", "1460")),
        ((-0.2, -0.31, 0.05), ("-0.20", "-0.31", "0.05")),
    ],
)
def test_an_interval_has_the_digits_of_its_width(values, said) -> None:
    assert say_interval(*values) == said
