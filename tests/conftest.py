"""Fixtures shared by all tests."""

from pathlib import Path

import pytest
from hypothesis import settings

# The first use of a kernel or of pykep takes seconds: no deadline for a single example.
settings.register_profile("default", deadline=None)
settings.load_profile("default")


@pytest.fixture(scope="session")
def shared() -> Path:
    """Return the folder of official tables and reference legs beside the checkout, or skip."""
    path = Path(__file__).resolve().parents[2] / "shared"
    if not (path / "gtoc").is_dir():
        pytest.skip("the official GTOC tables and reference legs (../shared) are not here")
    return path
