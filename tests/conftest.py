"""Fixtures shared by all tests."""

from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def shared() -> Path:
    """Return the folder of official tables and reference legs beside the checkout, or skip."""
    path = Path(__file__).resolve().parents[2] / "shared"
    if not (path / "gtoc").is_dir():
        pytest.skip("the official GTOC tables and reference legs (../shared) are not here")
    return path
