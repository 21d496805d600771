"""What the documentation's site has beside the pages of this folder.

The pages are written for a code-hosting site. Here their navigation is made from README.md,
CONTRIBUTING.md, CHANGELOG.md and the files that pages link to join them, and the reference is
made: of the public names of both packages from their docstrings, of the commands from their help.
"""

import ast
import contextlib
import io
import os
import re
from pathlib import Path, PurePosixPath
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
JOINING = {"CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}
"""Files of the repository's root that are pages of the site."""

PUBLIC = {
    "seqsearch": "Search for tours.",
    "seqsearch.polish": "Improve tours that were found.",
    "feasibility": "Legs: solve them, and know which can be flown.",
    "feasibility.orbits": "Bodies: tables, elements, Kepler motion, Lambert arcs, neighbours.",
    "feasibility.dataset": "Datasets of labelled legs.",
}
"""Packages whose public names have a page, with what they are for."""

EXTENDING = "reference/extending.md"
COMMANDS = "reference/commands.md"
PROGRAMS = ("seqsearch", "feasibility")


def on_config(config: Any) -> Any:
    """Make the navigation: the sections of README.md, then the project's pages and reference."""
    nav: list[dict[str, Any]] = [{"Documentation": "README.md"}]
    sections = re.split(r"^## ", (DOCS / "README.md").read_text(encoding="utf-8"), flags=re.M)
    for section in sections[1:]:
        title = section.partition("\n")[0].strip()
        links = re.findall(r"^- \[([^\]]+)\]\(([^)#]+\.md)\)", section, re.M)
        nav.append({title: [{name: page} for name, page in links]})
    reference = [{package: _page(package)} for package in PUBLIC]
    reference += [{"Extension points": EXTENDING}, {"Commands": COMMANDS}]
    nav += [{"Reference": reference}]
    nav += [{"Project": [{"Contributing": "contributing.md"}, {"Changelog": "changelog.md"}]}]
    config["nav"] = nav
    return config


def on_files(files: Any, config: Any) -> Any:
    """Add the pages that are not in this folder."""
    from mkdocs.structure.files import File

    pages = {_page(package): _names_page(package) for package in PUBLIC}
    pages |= {EXTENDING: _extending_page(), COMMANDS: _commands_page()}
    pages |= {page: (ROOT / name).read_text("utf-8") for name, page in JOINING.items()}
    for page, text in pages.items():
        files.append(File.generated(config, page, content=text))
    for path in _linked_files():
        files.append(File.generated(config, _copied(path), abs_src_path=str(path)))
    return files


def _copied(path: Path) -> str:
    """Return where the site has a file that is no page."""
    return f"files/{path.relative_to(ROOT).as_posix()}"


def _linked_files() -> list[Path]:
    """Return the files outside this folder, pages excepted, to which pages link."""
    found = set()
    for page in [*DOCS.rglob("*.md"), *(ROOT / name for name in JOINING)]:
        for target in re.findall(r"\]\((?!\w+:)([^)#\s]+)", page.read_text(encoding="utf-8")):
            path = Path(os.path.normpath(page.parent / target))
            if path.is_file() and not path.is_relative_to(DOCS) and path.name not in JOINING:
                found.add(path)
    return sorted(found)


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Lead links to where the site has their targets, and part blocks as its parser needs it."""
    source = page.file.src_uri
    parts = re.split(r"(^```.*?^```$)", markdown, flags=re.M | re.S)
    # Every second part is a block of code.
    parts[::2] = [_parted(_led(text, source)) for text in parts[::2]]
    return "".join(parts)


def _led(text: str, source: str) -> str:
    home = {page: name for name, page in JOINING.items()}.get(source)
    folder = ROOT if home else (DOCS / source).parent

    def lead(match: "re.Match[str]") -> str:
        target, anchor = match[1], match[2] or ""
        file = Path(os.path.normpath(folder / target))
        if file.parent == ROOT and file.name in JOINING:
            there = JOINING[file.name]
        elif file.is_relative_to(DOCS):
            there = file.relative_to(DOCS).as_posix()
        elif file.is_file():
            there = _copied(file)
        else:
            return match[0]
        here = PurePosixPath(source).parent.as_posix()
        return f"]({os.path.relpath(there, here)}{anchor})"

    return re.sub(
        r"\]\((?!\w+:)([^)#\s]+)(#[^)\s]*)?\)", lambda m: lead(m) if m[1] else m[0], text
    )


def _parted(text: str) -> str:
    """Put an empty line before each list and table that follows a paragraph."""
    block = re.compile(r"(?:\||[-*] |\d+\. )")
    lines: list[str] = []
    for line in text.split("\n"):
        before = lines[-1] if lines else ""
        if block.match(line) and before.strip() and not re.match(r"\s|\||[-*] |\d+\. ", before):
            lines.append("")
        lines.append(line)
    return "\n".join(lines)


def _page(package: str) -> str:
    return f"reference/{package}.md"


def public_names(package: str) -> list[str]:
    """Return what a package lists in ``__all__``."""
    path = ROOT.joinpath(*package.split("."), "__init__.py")
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
            names: list[str] = ast.literal_eval(node.value)
            return names
    raise LookupError(f"{path}: no __all__")


def _names_page(package: str) -> str:
    entries = [f"::: {package}.{name}" for name in public_names(package)]
    return "\n\n".join([f"# {package}", PUBLIC[package], *entries]) + "\n"


def _extending_page() -> str:
    """Return the page of the contracts that docs/extending.md names and no package lists."""
    text = (DOCS / "extending.md").read_text(encoding="utf-8")
    dotted = re.findall(r"`((?:feasibility|seqsearch)\.[\w.]+)`", text)
    listed = {f"{package}.{name}" for package in PUBLIC for name in public_names(package)}
    entries = [f"::: {name}" for name in dict.fromkeys(dotted) if name not in listed]
    about = "The contracts of [extension points](../extending.md), and what they work with."
    return "\n\n".join(["# Extension points", about, *entries]) + "\n"


def _commands_page() -> str:
    blocks = ["# Commands", "What `--help` says."]
    for program in PROGRAMS:
        overview = _help(program)
        blocks += [f"## {program}", f"```text\n{overview}```"]
        for command in re.findall(r"^    ([\w-]+)", overview, re.M):
            blocks += [f"### {program} {command}", f"```text\n{_help(program, command)}```"]
    return "\n\n".join(blocks) + "\n"


def _help(program: str, *command: str) -> str:
    import importlib

    main = importlib.import_module(f"{program}.commands.cli").main
    said = io.StringIO()
    width = os.environ.get("COLUMNS")
    os.environ["COLUMNS"] = "96"
    try:
        with contextlib.redirect_stdout(said), contextlib.suppress(SystemExit):
            main([*command, "--help"])
    finally:
        if width is None:
            del os.environ["COLUMNS"]
        else:
            os.environ["COLUMNS"] = width
    return said.getvalue()
