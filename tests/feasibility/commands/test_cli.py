"""The command line: numbers out of range are one line, other mistakes argparse's own."""

import pytest

from feasibility.commands.cli import main
from feasibility.dataset import builtin_protocols


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["generate", "search", "--legs", "0", "--out", "d"], "--legs 0: expected one or more"),
        (["inspect", "d", "--resolve", "-1"], "--resolve -1: expected zero or more"),
        (["train", "d", "--seed", "-1"], "--seed -1: expected zero or more"),
        (["assess", "f", "--legs", "0"], "--legs 0: expected one or more"),
        (
            ["retrain", "f", "--out", "m", "--general-test-legs", "0"],
            "--general-test-legs 0: expected one or more",
        ),
        (["retrain", "f", "--out", "m", "--threads", "0"], "--threads 0: expected one or more"),
        (["study", "all", "--workers", "-3"], "--workers -3: expected one or more"),
    ],
)
def test_numbers_out_of_range_are_one_line_and_exit_code_2(capsys, words, message):
    assert main(words) == 2
    assert capsys.readouterr().err == f"feasibility: {message}\n"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["generate", "search", "--legs", "x", "--out", "d"], "invalid int value: 'x'"),
        (["study", "nothing"], "invalid choice"),
        (["train", "d", "--sed", "1", "--nonsense"], "unrecognized arguments"),
    ],
)
def test_other_mistakes_show_how_the_command_is_used(capsys, words, message):
    with pytest.raises(SystemExit) as caught:
        main(words)
    assert caught.value.code == 2
    error = capsys.readouterr().err
    assert error.startswith("usage: feasibility")
    assert message in error


def test_protocols_are_listed_and_printed(capsys):
    assert main(["protocols"]) == 0
    listed = [line.split()[0] for line in capsys.readouterr().out.splitlines()]
    assert listed == list(builtin_protocols())
    assert main(["protocols", "table1"]) == 0
    assert capsys.readouterr().out == builtin_protocols()["table1"]
    assert main(["protocols", "table2"]) == 2
    assert "no such protocol; known are arrival, flyby, general" in capsys.readouterr().err
