"""The commands that the documentation shows, as lists of words."""

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
]
PROGRAMS = ("seqsearch", "feasibility")


@dataclass(frozen=True)
class Shown:
    """A command, where it is shown, and whether whole or as a phrase of a sentence."""

    page: str
    words: tuple[str, ...]
    whole: bool

    def __str__(self) -> str:
        return f"{self.page}: {' '.join(self.words)}"


def blocks(page: Path, language: str = "sh") -> list[str]:
    """Return the blocks of a page in a language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", page.read_text("utf-8"), re.M | re.S)


def shown_commands() -> list[Shown]:
    """Return every command of our programs and scripts, in blocks and within sentences."""
    found = []
    for page in PAGES:
        name = str(page.relative_to(ROOT))
        text = page.read_text(encoding="utf-8")
        fenced = re.findall(r"^```(\w*)\n(.*?)^```$", text, re.M | re.S)
        prose = re.sub(r"^```.*?^```$", "", text, flags=re.M | re.S)
        indented = "\n".join(re.findall(r"^ {4}(.*)$", prose, re.M))
        for block in [block for language, block in fenced if language in ("sh", "")] + [indented]:
            found += [Shown(name, words, True) for words in _commands(block)]
        for phrase in re.findall(r"`([^`]+)`", prose):
            found += [Shown(name, words, False) for words in _commands(" ".join(phrase.split()))]
    return list(dict.fromkeys(found))


def _commands(text: str) -> list[tuple[str, ...]]:
    """Return the commands of our programs among the lines of a text."""
    commands = []
    for line in text.replace("\\\n", " ").splitlines():
        if not re.match(r"(\$ )?(\.venv/bin/)?(seqsearch|feasibility|python3?|make|pip) ", line):
            continue
        words = shlex.split(line.removeprefix("$ "), comments=True)
        # What follows is the shell's.
        ends = [k for k, word in enumerate(words) if word in ("&", "&&", "|", ";", ">", "2>&1")]
        words = words[: min(ends, default=len(words))]
        commands.append((words[0].removeprefix(".venv/bin/"), *words[1:]))
    return commands
