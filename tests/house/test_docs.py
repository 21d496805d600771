"""The documentation: links lead somewhere, names exist, the README fits on a screen."""

import importlib
import importlib.util
import re
import subprocess
import sys
import tomllib
from itertools import pairwise
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
]
PACKAGES = ("feasibility", "seqsearch")
pages = pytest.mark.parametrize(
    "page", PAGES, ids=lambda page: str(page.relative_to(ROOT)).replace("/", "-")
)


def _text(page: Path) -> str:
    """Return a page without its blocks of code."""
    return re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)


def _links(page: Path) -> list[tuple[Path, str]]:
    """Return the targets of relative links and images: file, and anchor or nothing."""
    targets = re.findall(r"\]\(([^)\s]+)\)", _text(page))
    local = [target for target in targets if not re.match(r"\w+:", target)]
    split = [target.partition("#") for target in local]
    return [((page.parent / file).resolve() if file else page, mark) for file, _, mark in split]


def _anchors(page: Path) -> set[str]:
    """Return the anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)$", _text(page), re.M)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in headings}


def _names(page: Path) -> set[str]:
    """Return what stands in backticks."""
    return set(re.findall(r"`([^`\n]+)`", _text(page)))


@pages
def test_links_and_images_lead_somewhere(page):
    for target, anchor in _links(page):
        assert target.exists(), target
        assert not anchor or anchor in _anchors(target), f"{target}#{anchor}"


@pages
def test_names_of_modules_and_their_members_exist(page):
    dotted = re.compile(rf"(?:{'|'.join(PACKAGES)})(?:\.\w+)+")
    for name in filter(dotted.fullmatch, _names(page)):
        # Entry points have dotted names too, which name nothing that can be imported.
        if name not in _entry_point_groups():
            assert _exists(name), name


@pages
def test_paths_of_files_and_folders_exist(page):
    roots = (*PACKAGES, "docs", "examples", "benchmarks", "training", "tests")
    path = re.compile(rf"(?:{'|'.join(roots)})/[\w./-]*")
    for name in filter(path.fullmatch, _names(page)):
        if page.name != "CONTRIBUTING.md" or "bands" not in name:
            assert (ROOT / name).exists(), name


def _exists(name: str) -> bool:
    parts = name.split(".")
    for k in range(len(parts), 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:k]))
        except ModuleNotFoundError:
            continue
        for part in parts[k:]:
            if not hasattr(found, part):
                return False
            found = getattr(found, part)
        return True
    return False


def _entry_point_groups() -> set[str]:
    from seqsearch.problems import registry
    from seqsearch.tours import tour_files
    from seqsearch.tours.events import make as events
    from seqsearch.tours.export import make as exports
    from seqsearch.tours.scores import make as scores

    return {
        registry.ENTRY_POINTS,
        events.ENTRY_POINTS,
        scores.ENTRY_POINTS,
        exports.ENTRY_POINTS,
        tour_files.UPGRADES,
    }


def test_every_page_can_be_found():
    index = {target for page in PAGES[:1] for target, _ in _links(page)}
    index |= {target for target, _ in _links(ROOT / "docs" / "README.md")}
    assert ROOT / "docs" / "README.md" in index
    assert set(PAGES) - index <= {ROOT / "README.md"}


def test_every_picture_is_shown():
    shown = {target for page in PAGES for target, _ in _links(page)}
    pictures = {*(ROOT / "docs").rglob("*.png"), *(ROOT / "docs").rglob("*.svg")}
    assert pictures <= shown


def test_the_readme_is_one_screen():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 100
    assert len(text.split()) <= 700


@pages
def test_speeds_stand_under_results_only(page):
    if "results" not in page.parts:
        assert not re.search(r"legs/s|\b(?:us|ms|microseconds) a (?:leg|start|call)", _text(page))


@pages
def test_phrases_that_no_native_speaker_would_use_are_absent(page):
    assert not re.search(
        r"\bso many\b|\bwhom to\b|\bsought is\b|\bunknown are\b", _text(page), re.I
    )


def _blocks(page: str) -> list[str]:
    """Return the blocks of Python of a page."""
    return re.findall(r"^```python\n(.*?)^```$", (ROOT / page).read_text(), re.M | re.S)


def _output(script: str, folder: Path) -> str:
    path = folder / "script.py"
    path.write_text(script, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, str(path)], check=False, capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_code_of_the_guide_runs(tmp_path):
    assert _output("".join(_blocks("docs/guide/python.md")), tmp_path)


def test_the_code_about_legs_runs(tmp_path):
    _output("".join(_blocks("docs/guide/legs.md")), tmp_path)


@pytest.mark.slow
def test_the_code_of_the_readme_prints_what_it_says(tmp_path):
    (block,) = _blocks("README.md")
    promised = (ROOT / "README.md").read_text().split(block)[1].split("```\n")[2]
    # Which tour is best may hang on the last digit of a sum, and so on the processor.
    tour, summary, verified = _output(block, tmp_path).splitlines()
    assert [len(line.split()) for line in promised.splitlines()] == [
        len(tour.split()),
        len(summary.split()),
        len(verified.split()),
    ]
    assert promised.splitlines()[2] == verified


def test_the_loop_that_the_house_shows_is_the_beams():
    (block,) = _blocks("docs/design/house.md")
    assert block in (ROOT / "seqsearch" / "beam" / "beam_search.py").read_text()


def _program(path: str):
    spec = importlib.util.spec_from_file_location("drawing", ROOT / path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def plan():
    """The program that draws the plan of the house."""
    return _program("docs/design/plan.py")


def test_the_ends_of_legs_are_drawn_as_their_program_says():
    drawn = (ROOT / "docs" / "guide" / "legs.svg").read_text(encoding="utf-8")
    assert drawn == _program("docs/guide/legs.py").svg(), "run python docs/guide/legs.py"


def test_the_plan_is_drawn_as_its_program_says(plan):
    drawn = (ROOT / "docs" / "design" / "plan.svg").read_text(encoding="utf-8")
    assert drawn == plan.svg(), "run python docs/design/plan.py"


@pytest.mark.parametrize("package", PACKAGES)
def test_the_plan_has_every_room(plan, package):
    drawn = [room for floor in plan.FLOORS[package] for room in floor]
    rooms = [path.parent.name for path in (ROOT / package).glob("*/__init__.py")]
    there = rooms + [path.stem for path in (ROOT / package).glob("[!_]*.py")]
    assert sorted(drawn) == sorted(there)


def test_the_plan_has_the_floors_of_the_contracts(plan):
    rules = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]
    contracts = [rule for rule in rules["contracts"] if "containers" in rule]
    assert contracts
    for contract in contracts:
        (package,) = contract["containers"]
        level = {room: k for k, floor in enumerate(plan.FLOORS[package]) for room in floor}
        layers = [re.findall(r"\w+", layer) for layer in contract["layers"]]
        drawn = [[level[room] for room in layer] for layer in layers]
        for upper, lower in pairwise(drawn):
            assert max(upper) < min(lower)
