"""The documentation builds as a site: no warning, no page without its links."""

import os
import re
import subprocess
import sys
from pathlib import Path
from urllib.parse import unquote

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Return the folder of the site, built so that each warning is an error."""
    for package in ("material", "mkdocstrings", "mkdocstrings_handlers"):
        pytest.importorskip(package)
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT), "NO_MKDOCS_2_WARNING": "1"},
        check=False,
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, done.stderr
    return folder


def test_each_page_of_the_folder_is_one_of_the_site(site):
    for page in (ROOT / "docs").rglob("*.md"):
        name = page.relative_to(ROOT / "docs").with_suffix(".html")
        assert (site / (name if page.stem != "README" else name.with_stem("index"))).exists(), name


def test_links_between_the_pages_lead_somewhere(site):
    pages = {page: page.read_text(encoding="utf-8") for page in site.rglob("*.html")}
    anchors = {page: set(re.findall(r'\bid="([^"]+)"', text)) for page, text in pages.items()}
    for page, text in pages.items():
        if page.name == "404.html":
            continue
        for link in re.findall(r'<a [^>]*href="([^"]+)"', text):
            target, _, anchor = unquote(link).partition("#")
            if re.match(r"\w+:", target):
                continue
            there = (page.parent / target).resolve() if target else page
            assert there.exists(), f"{page.name}: {link}"
            if anchor and there in anchors:
                assert anchor in anchors[there] | {"__codelineno"} or "codelineno" in anchor, (
                    f"{page.name}: {link}"
                )


@pytest.mark.parametrize(
    ("page", "parts"),
    [
        ("seqsearch", ["seqsearch.search", "seqsearch.Tour", "max_solves", "Returns"]),
        ("feasibility", ["feasibility.Legs", "feasibility.optimise", "ClassifierPruner"]),
        ("extending", ["seqsearch.beam.frontiers.protocol.Frontier", "TourEvent"]),
        ("commands", ["seqsearch run", "feasibility generate", "--scheduler"]),
    ],
)
def test_the_reference_has_what_is_public(site, page, parts):
    text = (site / "reference" / f"{page}.html").read_text(encoding="utf-8")
    for part in parts:
        assert part in text, part


def test_every_public_name_has_its_entry(site):
    import feasibility
    import seqsearch

    for package in (feasibility, seqsearch):
        name = package.__name__
        text = (site / "reference" / f"{name}.html").read_text(encoding="utf-8")
        for public in package.__all__:
            assert f'id="{name}.{public}"' in text, public


def test_no_page_needs_the_network(site):
    for page in site.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        assert not re.findall(r'<(?:script|link|img)[^>]+(?:src|href)="https?:[^"]+"', text), page
