"""The page: what it says, and that it never obeys what strangers wrote."""

import json
import re
from html.parser import HTMLParser

import pytest

from feasibility.errors import InputError
from feasibility.runtime.atomic import write_text
from seqsearch.commands.cli import main
from seqsearch.report import write_report
from seqsearch.report.drawings import drawings
from seqsearch.report.material import gather
from seqsearch.tours.tour_files import to_json
from seqsearch.tours.trajectory_files import write_trajectory
from tests.helpers.handmade_tours import handmade_rows, handmade_run, handmade_tour

EVIL = "<script>window.hacked = 1</script>\"'&</pre><img src=x onerror=alert(1)>\u2028"


class _Elements(HTMLParser):
    """Collects tags, attributes, texts and what scripts hold."""

    def __init__(self, page):
        super().__init__()
        self.tags, self.attributes, self.words, self.data = [], [], [], ""
        self._inside = None
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs
        self._inside = tag if dict(attrs).get("id") == "data" else None

    def handle_data(self, text):
        if self._inside == "script":
            self.data += text
        self.words.append(text)

    def handle_endtag(self, tag):
        self._inside = None


def _page(run, tmp_path):
    out = tmp_path / "page.html"
    size = write_report(run, out)
    assert size == out.stat().st_size
    return out.read_text(encoding="utf-8")


def test_the_page_says_what_the_run_found(tmp_path):
    run = handmade_run(tmp_path / "run")
    page = _Elements(_page(run, tmp_path))
    words = " ".join(page.words)
    tour = handmade_tour()
    assert tour.one_line() in words
    assert tour.summary() in words
    for leg in tour.legs:
        for number in (f"{leg.tof_days:.2f}", f"{leg.m_final_kg:.2f}", f"{leg.margin:.3f}"):
            assert number in words
    for heading in (
        "Sequence", "Legs", "Trajectory", "Thrust and mass", "Visits and stays",
        "The beam, rank by rank", "Candidates kept and pruned", "Audit", "Seed and versions",
        "Settings",
    ):  # fmt: skip
        assert heading in page.words
    assert "not refined" in words
    assert "beam_width" in words
    assert page.words.count("9060") == 4, "hops proposed at each of four ranks"


def test_the_page_asks_no_network_and_runs_our_script_alone(tmp_path):
    page = _page(handmade_run(tmp_path / "run"), tmp_path)
    elements = _Elements(page)
    names = {name for name, _ in elements.attributes}
    assert not names & {"src", "href", "srcset", "action", "data", "style"}
    assert not {name for name in names if name.startswith("on")}
    assert not set(elements.tags) & {"link", "iframe", "img", "object", "embed", "form", "base"}
    assert elements.tags.count("script") == 2
    urls = set(re.findall(r"https?://[^\s\"'<]+", page))
    assert urls == {"http://www.w3.org/2000/svg"}
    assert "default-src 'none'" in page
    assert "unsafe" not in page
    assert len(page) < 8e6


def test_what_strangers_wrote_is_shown_and_not_obeyed(tmp_path):
    tour = handmade_tour(names=(EVIL, "</script><script>alert(2)</script>", "Gamma"), problem=EVIL)
    run = handmade_run(tmp_path / "run", tour)
    with (run / "config.toml").open("a") as file:
        file.write(f"# {EVIL}\n")
    record = json.loads((run / "provenance.json").read_text())
    record |= {"seed": EVIL, "command": [EVIL], "versions": {EVIL: EVIL}, "git_commit": EVIL}
    write_text(run / "provenance.json", json.dumps(record))
    audit = json.loads((run / "audit.json").read_text())
    audit["estimate"] |= {"found": EVIL, "false_prune_rate": EVIL, "interval": EVIL}
    audit["ranks"] = [{"pruned": [{"label": EVIL, "candidates": EVIL}], "kept": EVIL}]
    write_text(run / "audit.json", json.dumps(audit))
    page = _page(run, tmp_path)
    elements = _Elements(page)
    assert elements.tags.count("script") == 2
    assert elements.tags.count("img") == 0
    assert EVIL in "".join(elements.words)
    drawn = json.loads(elements.data)
    assert drawn["stops"][0]["name"] == EVIL
    assert "<" not in elements.data


def test_a_tour_file_alone_and_a_run_without_a_leg_have_pages_too(tmp_path):
    file = tmp_path / "sequence.json"
    write_text(file, to_json(handmade_tour()))
    words = _Elements(_page(file, tmp_path)).words
    assert "Trajectory" in words
    assert "Settings" not in words
    run = handmade_run(tmp_path / "run", handmade_tour(names=("Alone",)))
    words = _Elements(_page(run, tmp_path)).words
    assert "There is no leg yet." in words
    assert "Trajectory" not in words


def test_the_drawings_have_the_numbers_of_the_tour():
    tour = handmade_tour()
    record = drawings(_material(tour))
    assert [stop["number"] for stop in record["stops"]] == [0, 1, 2, 3]
    assert record["mass"][0][1] == 2000.0
    assert record["mass"][-1][1] == round(tour.m_final_kg, 4)
    assert max(force for leg in record["thrust"] for _, force in leg) == pytest.approx(0.24)
    for leg, visit in zip(tour.legs, record["visits"], strict=True):
        assert visit["arrival"] == round(leg.t_arr_mjd2000, 3)
    for stop, path in zip(record["stops"][1:], record["paths"], strict=True):
        assert path[-1] == pytest.approx(stop["at"], abs=2e-5)


def _material(tour):
    from seqsearch.report.material import Material
    from seqsearch.tours.export import Flight
    from seqsearch.tours.paths import impulsive_trajectory

    return Material(
        tour=tour,
        flight=Flight(tour, impulsive_trajectory(tour)),
        note="",
        ranks=(),
        candidates=(),
        audit={},
        config="",
        provenance={},
    )


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("counters.csv", "pass_number,rank\n1,x\n", "counters.csv, line 2"),
        ("candidates.csv", "kept,tof_days,predicted_margin,flyable\n1,nan,1,1\n", "not finite"),
        ("candidates.csv", "kept\n1\n", "candidates.csv, line 2"),
        ("audit.json", "{", "audit.json: no JSON"),
        ("provenance.json", "[]", "expected a JSON object"),
        ("config.toml", b"\xff\xfe", "config.toml: cannot be read"),
    ],
)
def test_damaged_files_are_named(tmp_path, name, content, message):
    run = handmade_run(tmp_path / "run")
    data = content if isinstance(content, bytes) else content.encode()
    (run / name).write_bytes(data)
    with pytest.raises(InputError, match=message):
        gather(run)


def test_the_command_writes_into_the_run_folder(tmp_path, capsys):
    run = handmade_run(tmp_path / "run")
    assert main(["report", str(run)]) == 0
    assert (run / "report.html").is_file()
    assert "report.html" in capsys.readouterr().out
    assert main(["report", str(tmp_path / "nothing")]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_refined_tour_is_shown_as_its_rows_fly_it(tmp_path):
    tour = handmade_tour()
    run = handmade_run(tmp_path / "run", tour)
    trajectory = handmade_rows(tour, later_days=1.5)
    write_trajectory(run, tour, trajectory, {})
    material = gather(run)
    assert material.flight.trajectory.continuous
    record = drawings(material)
    for visit, leg, phase in zip(record["visits"], tour.legs, trajectory.phases, strict=True):
        assert visit["arrival"] == round(float(phase.t_mjd2000[-1]), 3)
        assert visit["arrival"] == pytest.approx(leg.t_arr_mjd2000 + 1.5, abs=1e-3)
    words = " ".join(_Elements(_page(run, tmp_path)).words)
    assert "refined to continuous thrust" in words
    assert f"{trajectory.phases[0].mass_kg[-1]:.2f}" in words

    # Rows of another tour are not shown, and the page says why.
    other = handmade_tour(tof_days=130.0)
    write_text(run / "sequence.json", to_json(other))
    words = " ".join(_Elements(_page(run, tmp_path)).words)
    assert "not refined" in words
    assert "refined from another tour" in words
