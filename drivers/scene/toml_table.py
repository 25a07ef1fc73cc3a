"""Tables of a scene file: entries are taken out by name and type, and what is left over is unknown."""

from __future__ import annotations

import dataclasses
import difflib
import types
from typing import Any, get_args, get_origin, get_type_hints

from uplift.meshes.checked import ModelError
from uplift.meshes.groups import GroupNames


class Table:
    """One table of the file: entries are taken out by name and type, and what is left over is unknown."""

    def __init__(self, table: dict[str, Any], where: str) -> None:
        """Take the table at the path `where` of the file."""
        self.rest = dict(table)
        self.where = where
        self.known: list[str] = []

    def key(self, name: str) -> str:
        """Return the path of an entry, such as plate.young."""
        return f"{self.where}.{name}" if self.where else name

    def note(self, *names: str) -> None:
        """Know the names of entries that are read only where they are there."""
        self.known += names

    def take(self, name: str, kind: Any, default: Any = dataclasses.MISSING) -> Any:
        """Take out the entry `name` of type `kind`. Raises `ModelError` if it is another type, or missing without a default."""
        self.known.append(name)
        if name not in self.rest:
            if default is dataclasses.MISSING:
                close = difflib.get_close_matches(name, [k for k in self.rest if k not in self.known], n=1)
                hint = f" (found {close[0]!r}: did you mean {name!r}?)" if close else ""
                raise ModelError(self.key(name), f"missing; expected {in_words(kind)}{hint}")
            return default
        return convert(self.rest.pop(name), kind, self.key(name))

    def section(self, name: str, kind: Any, *, optional: bool = False) -> Any:
        """Make the dataclass `kind` of the table `name`; None if it is optional and absent."""
        table = self.take(name, dict, default=None if optional else dataclasses.MISSING)
        if table is None:
            return None
        return Table(table, self.key(name)).whole(kind)

    def whole(self, kind: Any, /, **given: Any) -> Any:
        """Make the dataclass `kind` of this table and of what is `given`, and refuse any other entry."""
        values = self._fields(kind, given)
        self.finish()
        return self.make(kind, **values)

    def into(self, kind: Any, /, **given: Any) -> Any:
        """Make the dataclass `kind` of what is `given` and of the entries that bear the names of its other fields."""
        return self.make(kind, **self._fields(kind, given))

    def _fields(self, kind: Any, given: dict[str, Any]) -> dict[str, Any]:
        hints = get_type_hints(kind)
        values = dict(given)
        for field in dataclasses.fields(kind):
            hint = hints[field.name]
            if field.name in given:
                continue
            if dataclasses.is_dataclass(hint):
                made = self.section(field.name, hint, optional=True)
                if made is not None:
                    values[field.name] = made
                continue
            required = field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
            value = self.take(field.name, hint, default=dataclasses.MISSING if required else None)
            if value is not None:
                values[field.name] = value
        return values

    def make(self, kind: Any, /, **values: Any) -> Any:
        """Make the dataclass `kind` of `values`, its errors named by their place in the file."""
        try:
            return kind(**values)
        except ModelError as error:
            raise (error.under(self.where) if self.where else error) from None

    def entries(self, name: str) -> list[Table]:
        """Return the tables of [name] or [[name]]; none if absent."""
        self.known.append(name)
        value = self.rest.pop(name, [])
        tables = [value] if isinstance(value, dict) else value
        if not isinstance(tables, list) or not all(isinstance(t, dict) for t in tables):
            raise ModelError(self.key(name), f"expected a table [{name}] or tables [[{name}]], got {value!r:.40}")
        if isinstance(value, dict):
            return [Table(value, self.key(name))]
        return [Table(t, f"{self.key(name)}[{t['name'] if isinstance(t.get('name'), str) else i + 1}]") for i, t in enumerate(tables)]

    def finish(self) -> None:
        """Raise `ModelError` if an entry is left that nobody asked for."""
        for name in self.rest:
            close = difflib.get_close_matches(name, self.known, n=1)
            hint = f"did you mean {close[0]!r}?" if close else f"known here: {', '.join(self.known)}"
            raise ModelError(self.key(name), f"unknown key; {hint}")


def in_words(kind: Any) -> str:
    """Return a type as a user of TOML calls it."""
    words = {float: "a number", int: "a whole number", str: "a text in quotes", bool: "true or false", dict: "a table"}
    if kind == GroupNames:
        return "a text in quotes or an array of texts"
    if isinstance(kind, types.UnionType):
        return " or ".join(map(in_words, _present(kind)))
    if get_origin(kind) is tuple:
        return "an array of " + {float: "numbers", str: "texts", int: "whole numbers"}[get_args(kind)[0]]
    return words.get(kind, "an array" if kind is list else "a value")


def _present(kind: Any) -> list[Any]:
    """Return what may stand in the file of a type that may be several, or nothing."""
    return [option for option in get_args(kind) if option is not type(None)]


def convert(value: Any, kind: Any, key: str) -> Any:
    """Return a value of the file as `kind`, whole numbers as floats where those are asked for. Raises `ModelError` for another type."""
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        try:
            return float(value)
        except OverflowError:
            raise ModelError(key, "expected a number that a double can hold") from None
    if kind == GroupNames:
        kind = tuple[str, ...] if isinstance(value, list) else str
        if value == []:
            raise ModelError(key, "expected at least one name")
    if isinstance(kind, types.UnionType):  # a number or nothing: what stands in the file is the number
        options = _present(kind)
        fitting = [option for option in options if isinstance(value, option) and not isinstance(value, bool)]
        if len(options) > 1 and not fitting:
            raise ModelError(key, f"expected {in_words(kind)}, got {value!r:.60}")
        return convert(value, (fitting or options)[0], key)
    if get_origin(kind) is tuple:
        if not isinstance(value, list):
            raise ModelError(key, f"expected an array, got {value!r:.60}")
        return tuple(convert(item, get_args(kind)[0], key) for item in value)
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        raise ModelError(key, f"expected {in_words(kind)}, got {value!r:.60}")
    return value
