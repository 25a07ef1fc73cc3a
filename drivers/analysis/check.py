"""A scene checked before it is run: what it is, what it will cost, which methods can run it and what is doubtful about it."""

from __future__ import annotations

from typing import Any

from uplift.drivers.analysis.memory import GIB, check_memory, expected_bytes, expected_size
from uplift.drivers.scene.analysis import METHODS
from uplift.drivers.scene.cautions import scene_cautions
from uplift.drivers.scene.refinement import kinematics_of
from uplift.drivers.scene.request import IN_A_BASIS, Request
from uplift.drivers.scene.scene import Scene
from uplift.forms.parameters import PlateModel
from uplift.meshes.checked import ModelError
from uplift.meshes.groups import groups_in_words
from uplift.meshes.imported import MeshFile
from uplift.meshes.panels import Panels
from uplift.meshes.plate import Plate
from uplift.meshes.sources import MeshSource

QUICK = 50_000
"""Expected dofs up to which a scene is meshed and assembled to be checked."""


def check_scene(scene: Scene, comm: Any, *, mesh: bool, method: str = "") -> list[str]:
    """Return lines on a scene that has been read; `mesh`: mesh and assemble it too, if that is quick (collective).

    Raises `ModelError` for what a run by `method`, or by the scene's own, would refuse; what only the mesh can tell are groups that
    it does not have, supports on no node, a plate off its supports.
    """
    method = method or scene.run.method
    request = _request(scene, method)
    request.check(scene)
    check_memory(scene, request, comm, groups=None, limit=None)
    size, plausible = expected_size(scene, is_complex=False), ""
    unrestrained: tuple[str, ...] = ()
    model, dofs, kind = scene.model, f"some {size.n}", _expected_kind(scene)
    if mesh and size.n <= QUICK:
        from uplift.drivers.analysis.assembled_scene import prepare
        from uplift.drivers.analysis.plausibility import plausibility

        with prepare(scene, comm) as assembly:
            assembled = assembly.plate
            model, unrestrained = assembled.model, assembled.unrestrained
            request.check_held(scene, unrestrained)
            if assembled.model.initial:
                from uplift.drivers.analysis.initial_conditions import changes

                changes(assembly)
            plausible = plausibility(assembly, rest_needed=request.needs_rest(scene))
            dofs = f"{assembly.operators.n} (meshed and assembled)"
            kind = f"{assembled.kind}, moves along {', '.join(assembled.components)}; {assembled.total_mass:,.1f} kg"
    elif mesh:
        dofs += " (too many to be meshed for a check; supports and groups are found when it is run)"
    lines = [
        f"title       {scene.title or '(none)'}", f"mesh        {_mesh_in_words(scene.plate)}",
        f"dofs        {dofs}", f"kinematics  {kind}", *_supports(model), *_loads(scene),
        *[f"plausible   {plausible}"] * bool(plausible),
    ]
    lines += _methods(scene, unrestrained, comm.size)
    if unrestrained:
        lines.append(f"free        nothing holds the plate against {' and '.join(unrestrained)}")
    return [*lines, *(f"{found.severity:<11} {found.text}" for found in scene_cautions(scene))]


def _request(scene: Scene, method: str) -> Request:
    basis = scene.basis.tolerance if scene.basis is not None and method in IN_A_BASIS else None
    return Request(method, (scene.run.iterations or None) if method == scene.run.method else None, basis=basis)


def _mesh_in_words(mesh: MeshSource) -> str:
    degree = f", degree {mesh.degree}" if mesh.degree else ""
    if isinstance(mesh, Plate):
        return f"rectangle of {mesh.width:g} m x {mesh.height:g} m, {mesh.nx} x {mesh.ny} {mesh.cell}s{degree}"
    if isinstance(mesh, Panels):
        return f"{len(mesh.plates)} plates of {mesh.area:.4g} m2 in {mesh.cell}s of {mesh.size:g} m{degree}"
    return f"file {mesh.path}{degree}"


def _expected_kind(scene: Scene) -> str:
    if isinstance(scene.plate, MeshFile):
        return scene.kinematics.kind or "found when the mesh is read"
    return kinematics_of(scene.plate, scene.kinematics, scene.model)[0]


def _supports(model: PlateModel) -> list[str]:
    lines = []
    for support in model.supports:
        where = f"{len(support.points)} at points" if support.points else f"on the group {groups_in_words(support.group)}"
        how = f"push along {support.unilateral} and cannot pull" if support.unilateral else "bonded"
        more = [f"gap {support.gap:g} m"] * bool(support.gap) + [f"preload {support.preload:g} N"] * bool(support.preload)
        lines.append(f"supports    {', '.join([f'{support.name}: {where}', how, *more])}")
    for spring in model.springs:
        where = f"{len(spring.points)} at points" if spring.points else f"on the group {groups_in_words(spring.group)}"
        lines.append(f"springs     {spring.name}: {where}")
    return lines or ["supports    none"]


def _loads(scene: Scene) -> list[str]:
    model = scene.model
    parts = [f"gravity {model.gravity:g} m/s2"] * bool(model.gravity)
    for number, name in ((len(model.motions), "ground motion"), (len(model.forces), "force"), (len(model.pressures), "pressure")):
        parts += [f"{number} {name}{'s' if number > 1 else ''}"] * bool(number)
    return [f"loads       {', '.join(parts) or 'none'}"]


def _methods(scene: Scene, unrestrained: tuple[str, ...], ranks: int) -> list[str]:
    lines = []
    for method in METHODS:
        own, request = method == scene.run.method, _request(scene, method)
        try:
            request.check(scene)
            request.check_held(scene, unrestrained)
        except ModelError as error:
            lines.append(f"method      {method + ':':<16}no; {error}")
            continue
        usual = "; the scene's own" if own else ""
        need = expected_bytes(scene, request, ranks, None) / GIB
        where = f"{request.scalars} PETSc{', in a basis' if request.basis else ''}"
        lines.append(f"method      {method + ':':<16}yes, {where}, some {need:.2g} GiB{usual}")
    return lines
