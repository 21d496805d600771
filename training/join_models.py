"""Join two models: the nets for free ends of one, everything else of the other.

Nets for legs from rest to rest and those for free ends are trained apart, and so can come from
different trainings:

    python training/join_models.py RENDEZVOUS.seqmodel FREE.seqmodel --out whole.seqmodel
"""

import argparse
import sys
from pathlib import Path

from feasibility import FeasibilityClassifier
from feasibility.learning.margin.train import with_free_ends_of


def main() -> int:
    """Join the models and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("model", help='model whose other nets are kept, or "default"')
    parser.add_argument("free", help="model whose nets for free ends are taken")
    parser.add_argument("--out", type=Path, required=True, help="file of the joined model")
    options = parser.parse_args()
    model, free = (FeasibilityClassifier.load(path) for path in (options.model, options.free))
    joined = with_free_ends_of(model.artefact, free.artefact)
    FeasibilityClassifier(joined)  # refuses what does not fit together
    joined.save(options.out)
    print(f"wrote {options.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
