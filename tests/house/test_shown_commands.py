"""Each command that the documentation shows is one that the programs understand."""

import argparse
import importlib
import os
import re
import runpy
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests.helpers.shown_commands import PROGRAMS, ROOT, Shown, blocks, shown_commands

COMMANDS = [
    shown
    for shown in shown_commands()
    # The first line of a file, no command.
    if shown.words[:2] != ("seqsearch", "checkpoint")
]
INCOMPLETE = re.compile(
    r"arguments are required|expected (?:at least )?one argument|unrecognized arguments: \.\.\."
    r"|invalid \w+ value: '[A-Z]+'|invalid choice: '[\w-]+\|"
)
TUTORIAL = ROOT / "docs" / "tutorial.md"


class _UnderstoodError(BaseException):
    """The arguments were read; what they ask for is not done."""


@pytest.fixture
def parse_only(monkeypatch):
    """Let every program end once it has read its arguments."""
    read = argparse.ArgumentParser.parse_args

    def parse_args(parser, arguments=None, namespace=None):
        read(parser, arguments, namespace)
        raise _UnderstoodError

    monkeypatch.setattr(argparse.ArgumentParser, "parse_args", parse_args)


def _of(*programs: str) -> list[Shown]:
    return [shown for shown in COMMANDS if shown.words[0] in programs]


def _fault(program, arguments, capsys) -> str:
    """Return what a program says against its arguments, nothing if it takes them."""
    main = importlib.import_module(f"{program}.commands.cli").main
    return _said_against(lambda: main(list(arguments)), capsys)


def _said_against(call, capsys) -> str:
    try:
        call()
    except _UnderstoodError:
        return ""
    except SystemExit as end:
        return "" if not end.code else capsys.readouterr().err
    return capsys.readouterr().err


@pytest.mark.parametrize("shown", _of(*PROGRAMS), ids=str)
def test_a_command_is_understood(shown, parse_only, capsys):
    fault = _fault(shown.words[0], shown.words[1:], capsys)
    # A sentence may leave out what a command needs, and write dots, capitals or
    # a|b for it.
    if shown.whole or not INCOMPLETE.search(fault):
        assert not fault, fault


@pytest.mark.parametrize("shown", _of("python", "python3"), ids=str)
def test_a_script_is_there_and_takes_its_arguments(shown, parse_only, capsys, monkeypatch):
    script = ROOT / shown.words[1]
    if shown.words[1].startswith("-") or (shown.page == "docs/tutorial.md"):
        return
    assert script.is_file()
    if "argparse" not in script.read_text(encoding="utf-8"):
        return
    monkeypatch.setattr(sys, "argv", list(shown.words[1:]))
    monkeypatch.chdir(ROOT)
    monkeypatch.syspath_prepend(script.parent)
    assert not _said_against(lambda: runpy.run_path(str(script), run_name="__main__"), capsys)


def test_targets_and_extras_exist():
    targets = re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(), re.M)
    for shown in _of("make"):
        assert {word for word in shown.words[1:] if "=" not in word} <= set(targets), shown
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    for shown in _of("pip"):
        for extras in re.findall(r"\[([\w,]+)\]", " ".join(shown.words)):
            assert set(extras.split(",")) <= set(project["optional-dependencies"]), shown


def test_commands_are_found():
    assert len(_of("seqsearch")) > 20
    assert len(_of("feasibility")) > 10
    assert len(_of("python")) > 3


@pytest.mark.parametrize("program", PROGRAMS)
def test_the_help_of_a_program_shows_commands_that_it_understands(program, parse_only, capsys):
    assert not _fault(program, ["--help"], capsys)
    shown = re.findall(rf"^  {program} (.*?)(?:  .*)?$", capsys.readouterr().out, re.M)
    assert len(shown) > 3
    for line in shown:
        assert not _fault(program, line.split(), capsys), line


def _steps() -> list[tuple[str, str]]:
    """Return the tutorial's files and commands in their order; the installation is done."""
    text = TUTORIAL.read_text(encoding="utf-8").partition("\n## Search\n")[2]
    pattern = r"^(?:`(\S+)`\n\n)?```(\w+)\n(.*?)^```$"
    return [
        (name, content)
        for name, language, content in re.findall(pattern, text, re.M | re.S)
        if name or language == "sh"
    ]


def test_the_tutorial_does_what_it_says(tmp_path):
    programs = tmp_path / "bin"
    programs.mkdir()
    for name in PROGRAMS:
        program = programs / name
        call = f"import sys; from {name}.commands.cli import main; sys.exit(main())"
        program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -c "{call}" "$@"\n')
        program.chmod(0o755)
    python = programs / "python"
    python.write_text(f'#!/bin/sh\nexec "{sys.executable}" "$@"\n')
    python.chmod(0o755)
    folder = tmp_path / "work"
    folder.mkdir()
    said = ""
    for name, content in _steps():
        if name:
            (folder / name).write_text(content, encoding="utf-8")
        else:
            said += _run(content, folder, programs)
    assert said.count("\nverified\n") == 2
    assert "verified: True" in said
    assert (folder / "tour.png").stat().st_size > 10_000
    assert len(_steps()) == len(blocks(TUTORIAL)) - 1 + 2


def _run(commands: str, folder: Path, programs: Path) -> str:
    done = subprocess.run(
        ["sh", "-e", "-c", commands],
        cwd=folder,
        env=os.environ | {"PATH": f"{programs}:{os.environ['PATH']}", "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, commands + done.stdout + done.stderr
    return done.stdout
