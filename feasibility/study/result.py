"""`Table` and `Result`: what an experiment hands back and how it is written."""

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Final, final

from feasibility.errors import InputError
from feasibility.runtime.atomic import atomic_path, write_json, write_text
from feasibility.runtime.folders import make_folder

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Value = str | int | float | None
"""An entry of a table; None where there is nothing to say."""

FIGURE_FORMATS: Final = ("png", "svg")
"""Every figure is written in each of these."""

_RESULT: Final = "result.json"


@final
@dataclass(frozen=True)
class Table:
    """A table; rows are as wide as `columns`.

    Attributes
    ----------
    name : str
        File name without ending.
    title : str
        Heading in the report.
    columns : tuple of str
        Names of the columns.
    rows : tuple of tuple
        Entries.
    most_rows : int, optional
        How many rows the report shows, 0 for none of the table; the files have all.
    """

    name: str
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Value, ...], ...]
    most_rows: int | None = None

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.columns):
                raise ValueError(f"{self.name}: row of {len(row)}, columns {len(self.columns)}")

    def csv(self) -> str:
        """Return the table as CSV, numbers in full."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self.columns)
        writer.writerows(["" if value is None else value for value in row] for row in self.rows)
        return text.getvalue()

    def markdown(self, most_rows: int | None = None) -> str:
        """Return the table, or its first rows, as Markdown; numbers to four decimals."""
        lines = [self.columns, ["---"] * len(self.columns)]
        lines += [[_shown(value) for value in row] for row in self.rows[:most_rows]]
        return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def _shown(value: Value) -> str:
    if value is None:
        return "–"
    if isinstance(value, float):
        return f"{value:.4f}" if abs(value) < 100 else f"{value:.0f}"
    return str(value)


def spread(mean: float, deviation: float) -> str:
    """Return ``mean ± deviation`` as the tables print it, the mean alone where nothing spreads."""
    return f"{mean:.4f} ± {deviation:.4f}" if deviation > 0 else f"{mean:.4f}"


@final
@dataclass(frozen=True)
class Result:
    """The outcome of one experiment.

    Attributes
    ----------
    name : str
        Name of the experiment: its folder.
    title : str
        Heading in the report, with the paper's table or figure.
    about : str
        What was done, one paragraph.
    findings : tuple of str
        What the numbers say, one sentence each, made from the numbers.
    tables : tuple of Table
        The tables.
    figures : tuple of str
        Names of the figures, without ending.
    """

    name: str
    title: str
    about: str
    findings: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    figures: tuple[str, ...] = field(default=())

    def write(self, out: Path, drawings: Sequence["Figure"]) -> None:
        """Write tables (CSV, Markdown), figures (PNG, SVG) and ``result.json`` to ``out/name``.

        Parameters
        ----------
        out : Path
            Folder of the study.
        drawings : sequence of matplotlib.figure.Figure
            The drawing of each of `figures`.

        Raises
        ------
        InputError
            The folder cannot be written to.
        """
        import matplotlib as mpl

        folder = out / self.name
        make_folder(folder)
        for table in self.tables:
            write_text(folder / f"{table.name}.csv", table.csv())
            write_text(folder / f"{table.name}.md", table.markdown())
        for name, drawing in zip(self.figures, drawings, strict=True):
            for kind in FIGURE_FORMATS:
                # A fixed salt and no date: the same numbers give the same file.
                metadata = {"Date": None} if kind == "svg" else None
                with (
                    atomic_path(folder / f"{name}.{kind}") as temporary,
                    mpl.rc_context({"svg.hashsalt": name}),
                ):
                    drawing.savefig(temporary, format=kind, dpi=130, metadata=metadata)
        write_json(folder / _RESULT, asdict(self))

    @classmethod
    def read(cls, out: Path, name: str) -> "Result | None":
        """Return the result of an experiment as it was written, None if there is none.

        Raises
        ------
        InputError
            The file is damaged.
        """
        path = out / name / _RESULT
        if not path.exists():
            return None
        try:
            plain = json.loads(path.read_text(encoding="utf-8"))
            tables = tuple(
                Table(
                    name=table["name"],
                    title=table["title"],
                    columns=tuple(table["columns"]),
                    rows=tuple(tuple(row) for row in table["rows"]),
                    most_rows=table["most_rows"],
                )
                for table in plain["tables"]
            )
            return cls(
                name=plain["name"],
                title=plain["title"],
                about=plain["about"],
                findings=tuple(plain["findings"]),
                tables=tables,
                figures=tuple(plain["figures"]),
            )
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise InputError(f"{path}: expected the result of an experiment ({error!r})") from None

    def markdown(self, figure_folder: str) -> str:
        """Return the section of the report; figures are linked from `figure_folder`."""
        parts = [f"## {self.title}", self.about]
        for table in self.tables:
            if table.most_rows == 0:
                continue
            parts += [f"**{table.title}**", table.markdown(table.most_rows).rstrip()]
            if table.most_rows is not None and len(table.rows) > table.most_rows:
                parts.append(f"(the first {table.most_rows} of {len(table.rows)} rows)")
        parts += [
            f"![{self.title}]({figure_folder}{self.name}/{figure}.png)" for figure in self.figures
        ]
        if self.findings:
            parts.append("\n".join(f"- {finding}" for finding in self.findings))
        return "\n\n".join(parts) + "\n"
