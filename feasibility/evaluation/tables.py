"""Tables of figures as Markdown, aligned for people who read them in a terminal."""

from collections.abc import Iterable, Sequence


def markdown_table(headers: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table as Markdown; its entries are printed as they are, without a line end."""
    from tabulate import tabulate

    return tabulate(list(rows), list(headers), tablefmt="github", disable_numparse=True)
