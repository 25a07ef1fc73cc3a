"""Matrices and vectors over all dofs of the space, before any dof is left out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from typing import Any

import numpy as np
from dolfinx.fem.petsc import assemble_matrix, assemble_vector
from petsc4py import PETSc

from uplift.forms.assembly.compiled_forms import CompiledForms
from uplift.forms.assembly.normals import disagreeing, orientation
from uplift.forms.assembly.points import in_words
from uplift.forms.contact.rigid_motions import rigid_value
from uplift.forms.contact.supports import AXES, TRANSLATIONS
from uplift.forms.parameters import Part, PlateModel, Pressure
from uplift.forms.shells.material import Material
from uplift.meshes.checked import ModelError
from uplift.meshes.compat import Mat
from uplift.meshes.findings import say
from uplift.meshes.groups import GroupNames, groups_in_words


class FullSpace:
    """Matrices and vectors over all dofs of the space, before any dof is left out."""

    def __init__(self, compiled: CompiledForms, model: PlateModel) -> None:
        """Take the compiled forms and the parameters."""
        self.compiled = compiled
        self.tagged = compiled.tagged
        self._cells = {part.group: self._cells_of(part) for part in model.parts}
        self.materials = [model.material, *(part.material for part in model.parts)]
        self.model = model

    def _cells_of(self, part: Part) -> np.ndarray:
        try:
            return self.tagged.cells(part.group)
        except ModelError as error:
            raise ModelError(f"parts[{groups_in_words(part.group)}]", error.message) from None

    def set_material(self, **factors: Callable[[Material], float]) -> None:
        """Set every material function; `factors` name fields that are multiplied by a number of the material."""
        for field in fields(Material):
            function = getattr(self.compiled.material, field.name)
            factor = factors.get(field.name, lambda _: 1.0)
            function.x.array[:] = getattr(self.model.material, field.name) * factor(self.model.material)
            for part in self.model.parts:
                function.x.array[self._cells[part.group]] = getattr(part.material, field.name) * factor(part.material)

    def say_what_is_doubtful(self) -> None:
        """Say where parts overlap, and where a pressure acts on neighbouring cells of opposite normals (collective)."""
        comm, owned = self.tagged.mesh.comm, self.tagged.mesh.topology.index_map(2).size_local
        for second, later in enumerate(self.model.parts):
            for earlier in self.model.parts[:second]:
                both = np.intersect1d(self._cells[earlier.group], self._cells[later.group])
                shared = comm.allreduce(int(np.sum(both < owned)))
                if shared:
                    one, other = groups_in_words(earlier.group), groups_in_words(later.group)
                    say("parts", f"the parts {one!r} and {other!r} share {shared} cells, which are of {other!r}, the later one")
        for pressure in self.model.pressures:
            cells = self.tagged.cells(pressure.group) if pressure.group else np.arange(owned)
            pairs, middle = disagreeing(self.tagged.mesh, cells[cells < owned])
            found = [(here, place) for here, place in comm.allgather((pairs, middle)) if here]
            if found:
                count = sum(here for here, _ in found)
                say("normals", f"the pressure {pressure.name!r} acts to opposite sides of {count} pairs of neighbouring cells, one around "
                    f"{in_words(found[0][1])}: their normals, which follow the order of their nodes, disagree")

    def matrix(self, form: Any) -> Mat:
        """Assemble a matrix with the present material."""
        matrix = assemble_matrix(form)
        matrix.assemble()
        return matrix

    def area(self, group: GroupNames) -> np.ndarray:
        """Return the area (n_owned nodes,) in m2 of groups of cells, of all for "", that belongs to each node (collective)."""
        cells = self.tagged.cells(group) if group else slice(None)
        self.set_material()
        density, thickness = self.compiled.material.density.x.array, self.compiled.material.thickness.x.array
        inside = np.zeros(len(density))
        inside[cells] = 1.0
        density[:] = inside / thickness
        mass = self.matrix(self.compiled.mass)
        ones, shares = mass.createVecRight(), mass.createVecLeft()
        block = len(self.compiled.components)
        ones.array.reshape(-1, block)[:, 0] = 1.0
        mass.mult(ones, shares)
        area: np.ndarray = np.real(shares.array_r.reshape(-1, block)[:, 0]).copy()
        for thing in (mass, ones, shares):
            thing.destroy()
        return area

    def rigid(self, motion: int, center: np.ndarray) -> np.ndarray:
        """Return the rigid motion along or about an axis (n_field,) at the owned nodes."""
        owned = self.compiled.space.dofmap.index_map.size_local
        at = self.compiled.space.tabulate_dof_coordinates()[:owned]
        values = np.zeros((owned, len(self.compiled.components)))
        for column, name in enumerate(self.compiled.components):
            axis = AXES.index(name[1:])
            if axis >= TRANSLATIONS or motion < TRANSLATIONS:
                values[:, column] = rigid_value(at[0], axis, motion, center) if owned else 0.0
            else:
                turn = np.eye(3)[motion - TRANSLATIONS]
                values[:, column] = np.cross(turn, at - center)[:, axis]
        return values.ravel()

    def pressure(self, pressure: Pressure) -> np.ndarray:
        """Return the load vector (n_field,) of a pressure (collective)."""
        value = self.compiled.value
        assert value is not None
        value.x.array[:] = 0.0 if pressure.group else pressure.value
        if pressure.group:
            value.x.array[self.tagged.cells(pressure.group)] = pressure.value
        value.x.array[:] *= orientation(self.tagged.mesh)
        vector = assemble_vector(self.compiled.pressure)
        vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        owned = self.compiled.space.dofmap.index_map.size_local * len(self.compiled.components)
        values: np.ndarray = vector.array_r[:owned].copy()
        vector.destroy()
        return values
