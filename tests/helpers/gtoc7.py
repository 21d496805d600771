"""Where the results of GTOC7 are that tests read."""

from pathlib import Path

RESULTS = Path(__file__).parents[2] / "docs" / "results" / "gtoc7"
RECONSTRUCTION = RESULTS / "jpl-mother.json"
"""JPL's mother ship, as we reconstructed her path."""
