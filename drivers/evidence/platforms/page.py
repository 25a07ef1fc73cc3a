"""The tables of recorded platforms beside each other, as a page."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from uplift.drivers.evidence.platforms.record import COMMANDS, FACTS
from uplift.drivers.process import say
from uplift.drivers.results.folder import all_or_nothing, writable_folder
from uplift.meshes.checked import ModelError

NUMBER = re.compile(r"(?<![\w.])[-+]?\d[\d,]*(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\w.])")

ROUND_OFF = ("transient - Laplace", "figure", "notes", "rel. diff.")
"""Columns that state round-off or the condition of a matrix: their size is in the page's own limit, and no digit of them is stated."""


@dataclass
class Comparison:
    """How the numbers of a page on one platform agree with those of the reference."""

    equal: int = 0
    """Printed alike."""
    last_digit: int = 0
    """Apart by one unit of the last printed digit: the same to one digit less."""
    apart: list[str] = field(default_factory=list)
    """Cells that are apart by more, in words."""

    @property
    def numbers(self) -> int:
        """How many have been compared."""
        return self.equal + self.last_digit + len(self.apart)


def platforms(folders: list[Path], out: Path) -> bool:
    """Compare recorded platforms with the first of them and write the page; return whether all numbers are equal to the stated digits.

    Raises `ModelError` for a folder that holds no platform.
    """
    if len(folders) < 2:
        raise ModelError("FOLDER", "expected two recorded platforms at least")
    facts = []
    for folder in folders:
        if not (folder / FACTS).is_file():
            raise ModelError("FOLDER", f"{folder} holds no platform; record one with --record")
        facts.append(json.loads((folder / FACTS).read_text(encoding="utf-8")))
    names = [f"{fact['versions']['dolfinx']} on {fact['system'].partition(' (')[0]}" for fact in facts]
    found = {
        (page, name): compared(tables(folders[0] / f"{page}.md"), tables(folder / f"{page}.md"))
        for page in COMMANDS for name, folder in zip(names[1:], folders[1:], strict=True)
    }
    writable_folder(out.absolute().parent)
    with all_or_nothing(out.absolute().parent) as staging:
        (staging / out.name).write_text(_text(names, facts, found), encoding="utf-8")
    good = not any(comparison.apart for comparison in found.values())
    say(f"{sum(c.numbers for c in found.values())} numbers, {sum(len(c.apart) for c in found.values())} apart; page in {out}")
    return good


def tables(path: Path) -> list[tuple[str, str, str]]:
    """Return (row, column, cell) of all tables of a page, or of what `verify` prints, whose values count to the published digits."""
    cells: list[tuple[str, str, str]] = []
    header: list[str] = []
    for line in path.read_text(encoding="utf-8").splitlines():
        words = line.split()
        if line.startswith("|"):
            row = [cell.strip() for cell in line.strip().strip("|").split(" | ")]
            if set(line) <= set("|-: "):
                continue
            if header:
                cells += [(row[0], column, cell) for column, cell in zip(header, row, strict=True)]
            header = header or row
        elif len(words) == 7 and words[0] in ("transient", "time-frequency"):
            cells.append((" ".join(words[:4]), "here", f"{float(words[5]):.5e}"))
        else:
            header = []
    return cells


def compared(reference: list[tuple[str, str, str]], other: list[tuple[str, str, str]]) -> Comparison:
    """Compare all numbers of two pages, except those of the columns `ROUND_OFF`."""
    result = Comparison()
    if [cell[:2] for cell in reference] != [cell[:2] for cell in other]:
        result.apart.append("the rows or columns themselves")
        return result
    for (row, column, here), (_, _, there) in zip(reference, other, strict=True):
        if column in ROUND_OFF:
            continue
        numbers, others = NUMBER.findall(here), NUMBER.findall(there)
        if NUMBER.sub("", here) != NUMBER.sub("", there) or len(numbers) != len(others):
            result.apart.append(f"{row}, {column}: {here} and {there}")
            continue
        for a, b in zip(numbers, others, strict=True):
            if a == b:
                result.equal += 1
            elif abs(_value(a) - _value(b)) <= 1.01 * max(_unit(a), _unit(b)):
                result.last_digit += 1
            else:
                result.apart.append(f"{row}, {column}: {a} and {b}")
    return result


def _value(number: str) -> float:
    return float(number.replace(",", ""))


def _unit(number: str) -> float:
    """Return one unit of the last digit of a number as it is printed."""
    mantissa, _, exponent = number.replace(",", "").lower().partition("e")
    return float(10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2])))


def _text(names: list[str], facts: list[dict[str, Any]], found: dict[tuple[str, str], Comparison]) -> str:
    versions = [key for key in facts[0]["versions"] if key != "petsc scalars"]
    lines = [
        "# The same numbers on all releases", "",
        "The quick pages of evidence are made on each release of the libraries, in the complex build, and their tables compared number by "
        "number with those of the first one. Two numbers agree if they are printed alike, or are one unit of the last printed digit apart. "
        "Columns that state the size of round-off are left out. Meshes without structure, which each release of gmsh makes in its own way, "
        "are those of the first one.", "",
        "Each release is recorded on its own machine or in its own container, and the folders are then compared:", "",
        "    python3 -m drivers platforms --record FOLDER --meshes MESHES",
        "    python3 -m drivers platforms FOLDER FOLDER ... --out docs/platforms.md", "",
        "| | " + " | ".join(names) + " |", "|---" * (len(names) + 1) + "|",
        "| system | " + " | ".join(fact["system"] for fact in facts) + " |",
        *(f"| {key} | " + " | ".join(fact["versions"][key] for fact in facts) + " |" for key in versions), "",
        "## Numbers", "", "| page | release | numbers | printed alike | last digit | apart |", "|---|---|---:|---:|---:|---:|",
        *(f"| `{' '.join(COMMANDS[page])}` | {name} | {c.numbers} | {c.equal} | {c.last_digit} | {len(c.apart)} |"
          for (page, name), c in found.items()), "",
        *(line for (page, name), c in found.items() if c.apart
          for line in (f"Apart in `{page}` on {name}:", "", *(f"- {text}" for text in c.apart), "")),
        "## Times", "", f"Processor time in parts of that of the first release, one rank on {facts[0]['processor']}; "
        "start-up is `check --no-mesh`, which loads the libraries and little else. The compilation of forms that are not in the cache of a "
        "release is part of its times.", "",
        "| | " + " | ".join(names) + " |", "|---" + "|---:" * len(names) + "|",
        *(f"| {key} | " + " | ".join(f"{fact['seconds'][key] / facts[0]['seconds'][key]:.2f}" for fact in facts) + " |"
          for key in facts[0]["seconds"]),
    ]
    return "\n".join(lines) + "\n"
