"""``python -m seqsearch``: the same as the command ``seqsearch``."""

import sys

from seqsearch.commands.cli import main

if __name__ == "__main__":
    sys.exit(main())
