"""Parameters that check themselves: frozen dataclasses whose fields carry a unit and a range."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

LONGEST_MESSAGE = 1000
"""Characters of a message, whatever it quotes."""


class ModelError(ValueError):
    """What a model asks for cannot be: `key` names the parameter, the message what was expected of it."""

    def __init__(self, key: str, message: str) -> None:
        """Keep the key apart from the message, so that a driver can put the file's name before both; names in it may hold line breaks."""
        text = " ".join((f"{key}: {message}" if key else message).splitlines())
        text = "".join(c if c.isprintable() else repr(c)[1:-1] for c in text[: 2 * LONGEST_MESSAGE])
        super().__init__(text if len(text) <= LONGEST_MESSAGE else f"{text[:LONGEST_MESSAGE]} ...")
        self.key = key
        self.message = message

    def under(self, prefix: str) -> ModelError:
        """Return the same error with its key below `prefix`, as `plate` and `young` make `plate.young`."""
        return ModelError(f"{prefix}.{self.key}" if self.key else prefix, self.message)


def quantity(
    doc: str,
    unit: str = "",
    *,
    default: Any = dataclasses.MISSING,
    factory: Any = dataclasses.MISSING,
    above: float | None = None,
    at_least: float | None = None,
    below: float | None = None,
    at_most: float | None = None,
    one_of: tuple[str, ...] = (),
) -> Any:
    """Declare a field of a `Checked` dataclass with its meaning, unit, default and admissible range."""
    metadata = {
        "doc": doc, "unit": unit, "above": above, "at_least": at_least, "below": below, "at_most": at_most,
        "one_of": one_of,
    }
    if factory is not dataclasses.MISSING:
        return dataclasses.field(default_factory=factory, metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def range_in_words(metadata: Any) -> str:
    """Say the admissible range of a field as text, such as "> 0 and < 0.5" (empty if there is none)."""
    signs = (("above", ">"), ("at_least", ">="), ("below", "<"), ("at_most", "<="))
    return " and ".join(f"{sign} {metadata[name]:g}" for name, sign in signs if metadata.get(name) is not None)


def _finite(number: float) -> bool:
    """Tell whether a double can hold the number."""
    try:
        return math.isfinite(number)
    except OverflowError:  # a whole number of hundreds of digits
        return False


def _outside(number: float, metadata: Any) -> bool:
    return (
        (metadata.get("above") is not None and not number > metadata["above"])
        or (metadata.get("at_least") is not None and not number >= metadata["at_least"])
        or (metadata.get("below") is not None and not number < metadata["below"])
        or (metadata.get("at_most") is not None and not number <= metadata["at_most"])
    )


class Checked:
    """Base of the parameter dataclasses: every numeric field is finite and inside the range it declares."""

    def __post_init__(self) -> None:
        """Check each field, then the class's own `check`; raise `ModelError` naming the first field that fails."""
        for field in dataclasses.fields(self):  # type: ignore[arg-type]  # subclasses are dataclasses
            value = getattr(self, field.name)
            allowed = field.metadata.get("one_of")
            if allowed and value not in allowed:
                raise ModelError(field.name, f"expected one of {', '.join(filter(None, allowed))}, got {value!r:.60}")
            if isinstance(value, bool) or not isinstance(value, (int, float)):
                continue
            if not _finite(value) or _outside(value, field.metadata):
                expected = range_in_words(field.metadata) or "a finite number"
                unit = field.metadata.get("unit")
                raise ModelError(field.name, f"expected {expected}{f' {unit}' if unit else ''}, got {repr(value):.60}")
        self.check()

    def check(self) -> None:
        """Check what concerns several fields at once; subclasses with such a rule override this."""
