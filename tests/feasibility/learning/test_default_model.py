"""The scripts that make the default model: their families, and all of it once in small."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from feasibility import FeasibilityClassifier, Legs
from feasibility.orbits import read_catalogue

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def scripts():
    """The modules of the folder `training`."""
    sys.path.insert(0, str(ROOT / "training"))
    try:
        import default_model
        import final_mass_legs
    finally:
        sys.path.remove(str(ROOT / "training"))
    return default_model, final_mass_legs


def drawn(protocol, n=40):
    """Return `n` legs of a protocol."""
    rng = np.random.default_rng(1)
    catalogue = read_catalogue(Path(protocol.catalogue.file))
    return protocol.sampler.draw(n, rng, catalogue, protocol.craft(), protocol.impulsive_grid).legs


def test_all_families_can_be_drawn(scripts, shared):
    margins, flown = scripts
    tables = shared / "gtoc" / "official"
    protocols = {name: margins.protocol(name, tables) for name in margins.FAMILIES}
    protocols |= {f"flown {name}": flown.final_mass_protocol(name, tables) for name in flown.LEGS}
    protocols |= {f"fresh {name}": flown.fresh_protocol(name, tables) for name in flown.TESTS}
    for name, protocol in protocols.items():
        assert len(drawn(protocol)) == 40, name
    assert {name for name, _, _ in flown.TESTS.values()} <= set(flown.LEGS)


def test_too_small_a_share_is_refused_before_any_work(tmp_path):
    done = made(tmp_path, "--share", "0.001")
    assert done.returncode == 2
    assert "--share 0.001: expected at least" in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_all_of_it_in_small(tmp_path, shared):
    done = made(
        tmp_path, "--share", "0.006", "--epochs", "1", "--hard-rounds", "1", "--shared", shared
    )
    assert done.returncode == 0, done.stderr
    model = FeasibilityClassifier.load(str(tmp_path / "out" / "default.seqmodel"))
    legs = Legs(
        rv_dep=[1.5e11, 0.0, 0.0, 0.0, 29.7e3, 0.0],
        rv_arr=[-0.2e11, 1.7e11, 0.05e11, -27e3, -3e3, 400.0],
        tof_days=110.0,
        m0=1500.0,
        thrust=0.2,
        isp=3000.0,
        m_dry=500.0,
        vinf_dep=[0.0, 4000.0, 0.0],
        vinf_arr=[0.0, 0.0, np.inf],
    )
    answers = model.predict(legs)
    assert np.isfinite(answers.margin).all()
    # One table for the margins, one for the final masses.
    assert done.stdout.count("## all") == 2


def made(folder, *options):
    """Run the script and return how it ended."""
    line = [sys.executable, str(ROOT / "training" / "default_model.py")]
    line += ["--out", str(folder / "out"), "--workers", "1", *map(str, options)]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.run(
        line, cwd=ROOT, env=environment, capture_output=True, text=True, check=False
    )
