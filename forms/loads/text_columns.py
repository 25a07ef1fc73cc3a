"""Columns of numbers in a text file that a user brings: what spreadsheets, Matlab, Fortran and recorders write."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from uplift.meshes.checked import ModelError

LARGEST = 200_000_000
"""Bytes of a file; a larger one is a slip."""

LONGEST = 2000
"""Characters of a line of words that are looked at."""

REMARKS = ("#", "%", "!", "//")
"""What begins a line that holds no numbers."""

MARKS = (";", "\t", ",", "")
"""Separators in the order in which they are tried; the last stands for blanks."""

NUMBER = re.compile(r"[+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eEdDqQ][+-]?\d+)?|[+-]?(?:\d+[.,]\d*|[.,]\d+)[+-]\d{3}")
"""With point or comma; the exponent after E, D or Q, or bare with three digits, as Fortran writes it where the letter finds no room."""

NOT_FINITE = re.compile(r"[+-]?(?:nan|inf|infinity|1\.#\w*)|\*+", re.IGNORECASE)
"""Infinities, not-a-numbers and the asterisks of a Fortran field that was too narrow."""

NEARLY = re.compile(r"(?=.*\d|.*[Oo].*[.,]|.*[.,].*[Oo])[-+.,\dOoIlSB]*[.,\dOo][-+.,\dOoIlSBeEdD]*")
"""A number with slips in it, such as 0.0OO or 1..5."""

DATE = re.compile(r"\d{4}-\d\d?-\d\d?")


@dataclass(frozen=True)
class Row:
    """One line of numbers."""

    number: int
    """Of the line in the file, from 1."""
    text: str
    values: tuple[float, ...]


@dataclass
class TextColumns:
    """The columns of a file; the cells become numbers where they are asked for."""

    path: Path
    expected: str
    """What stands in a line, for messages."""
    width: int = 0
    """Columns; 0 where no line holds two numbers."""
    headings: list[tuple[str, ...]] = field(default_factory=list)
    """Lines of names and units before the numbers, with as many cells as there are columns."""
    remarks: list[str] = field(default_factory=list)
    """The other lines before the numbers."""
    lines: list[tuple[int, str, list[str]]] = field(default_factory=list)
    """Number, text and cells of each line of numbers."""

    def wrong(self, number: int, text: str, expected: str = "") -> ModelError:
        """Return the error of a line that holds something else."""
        return ModelError("", f"{self.path}, line {number}: {expected or self.expected}, got {text!r:.60}")

    def rows(self, columns: Sequence[int] = ()) -> Iterator[Row]:
        """Give the numbers of the `columns`, of all where none are named. Raises `ModelError` naming the line where one is missing."""
        decimal = ""
        for number, text, cells in self.lines:
            wanted = columns or range(self.width)
            if any(cell.strip() for cell in cells[self.width :]) or len(cells) <= max(wanted):
                raise self.wrong(number, text, f"{self.expected} in {self.width} columns as before")
            values = []
            for column in wanted:
                value, mark = _number(cells[column])
                if value is None or (mark and decimal and mark != decimal):
                    raise self.wrong(number, text)
                if not math.isfinite(value):
                    raise self.wrong(number, text, "expected finite numbers")
                decimal = decimal or mark
                values.append(value)
            yield Row(number, text, tuple(values))


def read_columns(path: Path, expected: str) -> TextColumns:
    """Read the columns of a file; `expected` says in messages what stands in a line.

    Text in UTF-8, UTF-16 or Latin-1. Separators are semicolons, tabs, commas or blanks; the decimal sign is a point, or a comma
    where commas separate nothing; cells may be quoted. Lines that begin with # % ! or // are remarks, as are lines of words before
    the first line of numbers. Raises `ModelError` naming the file and the line: a line of numbers with a slip in it is no heading.
    """
    table = TextColumns(path, expected)
    before: list[tuple[int, str]] = []
    mark: str | None = None
    for number, line in enumerate(re.split(r"\r\n|\r|\n", read_text(path).rstrip("\x1a")), start=1):
        if not line.strip(" \t;,\"'\f\xa0"):
            continue
        if line.lstrip().startswith(REMARKS):
            if mark is None:
                table.remarks.append(line.strip())
            continue
        plain = re.split(r"\s[#%!]", line, maxsplit=1)[0]
        if mark is None:
            mark = _separator(plain)
            if mark is None:
                before.append((number, line[:LONGEST]))
                continue
        table.lines.append((number, line, _cells(plain, mark)))
    first = table.lines[0][2] if table.lines else []
    # Columns that are empty throughout are those of a spreadsheet with more separators than columns.
    table.width = next((i for i in range(len(first), 0, -1) if any(line[2][i - 1 : i] not in ([], [""]) for line in table.lines)), 0)
    _read_headings(table, before, mark)
    return table


def _read_headings(table: TextColumns, before: list[tuple[int, str]], mark: str | None) -> None:
    """Sort the lines before the numbers into headings and remarks; refuse a line of numbers among them that has a slip in it."""
    for number, line in before:
        cells = _cells(line, mark) if mark is not None else re.split(r"[;\t, ]+", line.strip())
        if _number(cells[0])[0] is not None or any(map(_nearly, cells)):
            raise table.wrong(number, line)
        fitting = cells if mark != "" or len(cells) == table.width else _words(line)
        if len(fitting) >= table.width and not any(cell.strip() for cell in fitting[table.width :]):
            table.headings.append(tuple(cell.strip(" \"'\xa0") for cell in fitting[: table.width]))
        else:
            table.remarks.append(line.strip())


def read_text(path: Path) -> str:
    """Return the text of a file in UTF-8, UTF-16 or Latin-1. Raises `ModelError` if it is missing, too large or no text."""
    try:
        if not path.is_file():
            raise ModelError("", f"cannot read {path}: there is no such file")
        if path.stat().st_size > LARGEST:
            raise ModelError("", f"cannot read {path}: expected at most {LARGEST / 1e6:g} MB, it has {path.stat().st_size / 1e6:.0f}")
        data = path.read_bytes()
    except OSError as error:
        raise ModelError("", f"cannot read {path}: {error.strerror}") from error
    for encoding in (_encoding(data), "cp1252", "latin-1"):
        try:
            text = data.decode(encoding)
        except UnicodeDecodeError:
            continue
        if "\0" not in text:
            return text
        break
    raise ModelError("", f"cannot read {path}: not a text file")


def _encoding(data: bytes) -> str:
    """Return the likeliest encoding: by the mark at the beginning, or of UTF-16 without one by the zero in every other byte."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    start = data[:1000]
    if start[1::2].count(0) > 0.4 * len(start):
        return "utf-16-le"
    if start[::2].count(0) > 0.4 * len(start):
        return "utf-16-be"
    return "utf-8-sig"


def _separator(line: str) -> str | None:
    """Return the separator of a line of numbers, whose first two cells are some; None of another line."""
    for mark in MARKS:
        if mark and mark not in line:
            continue
        cells = _cells(line, mark)
        if len(cells) > 1 and all(_number(cell)[0] is not None for cell in cells[:2]):
            return mark
    return None


def _cells(line: str, mark: str) -> list[str]:
    """Split a line; blank cells are empty."""
    if not mark:
        return [cell.strip("\"'") for cell in re.findall(r'"[^"]*"|[^\s"]+', line)] or [""]
    quoted = '"' in line and len(line) <= LONGEST
    line = line.lstrip(" \t\f\xa0")
    cells = next(csv.reader([line], delimiter=mark, skipinitialspace=True)) if quoted else line.split(mark)
    return [cell.strip(" \t\f\xa0") for cell in cells]


def _words(line: str) -> list[str]:
    """Split the headings of a file whose columns are parted by blanks: a bracket belongs to the word before it."""
    words = re.findall(r'"[^"]*"|[^\s"(\[]+(?:\s*[(\[][^)\]]*[)\]])?|[(\[][^)\]]*[)\]]', line)
    return [word.strip('"') for word in words]


def _number(cell: str) -> tuple[float | None, str]:
    """Return the number in a cell and its decimal sign; None where there is none, a value that is not finite where that is written."""
    try:
        if cell.isascii() and "_" not in cell and math.isfinite(value := float(cell)):
            return value, "." if "." in cell else ""
    except ValueError:
        pass
    text = cell.strip(" \t\"'\f\xa0").replace("\N{MINUS SIGN}", "-")
    if not NUMBER.fullmatch(text):
        return (math.nan, "") if NOT_FINITE.fullmatch(text) else (None, "")
    mark = "," if "," in text else "." if "." in text else ""
    text = re.sub(r"(?<=[\d.])(?=[+-]\d{3}$)", "e", text.replace(",", "."))
    return float(re.sub("[dDqQ]", "e", text)), mark


def _nearly(cell: str) -> bool:
    text = cell.strip(" \t\"'\f\xa0")
    return _number(text)[0] is None and bool(NEARLY.fullmatch(text)) and not DATE.fullmatch(text)
