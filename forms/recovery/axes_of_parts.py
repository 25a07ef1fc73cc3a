"""The axes of internal forces in each part of a model."""

from __future__ import annotations

from uplift.forms.assembly.compiled_forms import CompiledForms
from uplift.forms.parameters import PlateModel
from uplift.forms.recovery.directions import Directions
from uplift.meshes.checked import ModelError
from uplift.meshes.groups import GroupNames, groups_in_words


class AxesOfParts:
    """The axes of the parts of a model, each looked up once."""

    def __init__(self, compiled: CompiledForms, model: PlateModel) -> None:
        """Take the parts; their axes are looked up when they are asked for."""
        self._tagged, self._usual = compiled.tagged, model.axes
        self._own = {part.group: part.axes for part in model.parts}
        self.parts = tuple(self._own)
        """Groups of cells of the parts, of which the later ones win."""
        self._found: dict[GroupNames | None, Directions] = {}

    def of(self, part: GroupNames | None) -> Directions:
        """Return the axes of a part, None for the plate (collective)."""
        if part not in self._found:
            own = self._own.get(part) if part is not None else None
            where = f"parts[{groups_in_words(part)}]" if part is not None and own is not None else "plate"
            try:
                self._found[part] = Directions(own or self._usual, self._tagged)
            except ModelError as error:
                raise ModelError(f"{where}.axes.{error.key or 'edge'}", error.message) from None
        return self._found[part]
