"""Provenance: what a result tells about the machine that made it."""

import sys

import pytest

from feasibility.runtime.provenance import provenance


@pytest.mark.parametrize(
    ("word", "told"),
    [
        ("data/search", "data/search"),
        ("/home/me/data", "data"),
        ("--out=/home/me/data", "--out=data"),
        ("name=value", "name=value"),
        ("lambert:1.3,mima2:0.97", "lambert:1.3,mima2:0.97"),
        ("postgresql://me:secret@host:5432/trials", "postgresql://me:***@host:5432/trials"),
        ("--storage=mysql+pymysql://me:se=cret@host/x", "--storage=mysql+pymysql://me:***@host/x"),
        ("sqlite:////home/me/trials.db", "sqlite:///trials.db"),
        ("tcp://host:8786", "tcp://host:8786"),
    ],
)
def test_folders_and_passwords_are_left_out_of_the_command(monkeypatch, word, told):
    monkeypatch.setattr(sys, "argv", ["feasibility", "train", word])
    assert provenance()["command"] == ["feasibility", "train", told]
