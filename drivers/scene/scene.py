"""A scene: what a TOML file says, as checked parameters."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from uplift.drivers.scene.analysis import Basis, Harmonic, Modal, Output, Run, Transient
from uplift.drivers.scene.mesh import read_mesh, with_nodes
from uplift.drivers.scene.model import read_model
from uplift.drivers.scene.paths import varied
from uplift.drivers.scene.refinement import finer_to
from uplift.drivers.scene.texts import see_texts
from uplift.drivers.scene.toml_table import Table
from uplift.forms.parameters import PlateModel
from uplift.forms.shells.kinematics import Kinematics
from uplift.meshes.checked import ModelError
from uplift.meshes.sources import MeshSource
from uplift.solvers.frequency_domain.window import Window

LARGEST_FILE = 50_000_000
"""Bytes of a scene; a million points in it take less."""


@dataclass(frozen=True)
class Scene:
    """A scene: the model, its mesh and how it is to be analysed."""

    title: str
    plate: MeshSource
    model: PlateModel
    kinematics: Kinematics
    transient: Transient | None
    fourier: Window | None
    modal: Modal | None
    harmonic: Harmonic | None
    basis: Basis | None
    output: Output
    run: Run
    source: dict[str, Any]
    """The TOML as read, for the record."""
    folder: Path
    """That file names in it are relative to."""

    def with_(self, path: str, value: Any) -> Scene:
        """Return the scene with the value at a dotted path changed, such as supports.RESS.gap; None takes it away (`scene.paths`).

        Raises `ModelError` for a path that leads nowhere and for a value that is refused.
        """
        return build_scene(varied(self.source, {path: value}), self.folder)

    @property
    def horizon(self) -> float:
        """Latest time in s that any analysis of the scene reaches."""
        return max(self.transient.duration if self.transient else 0.0, self.fourier.length if self.fourier else 0.0)


def read_scene(path: Path | str) -> Scene:
    """Read and check a scene file. Raises `ModelError`, its key the path of the offending entry, such as plate.young."""
    path = Path(path)
    try:
        if path.exists() and not path.is_file():
            raise ModelError("", "cannot be read: it is no file")
        if path.exists() and path.stat().st_size > LARGEST_FILE:
            raise ModelError("", f"expected a file of at most {LARGEST_FILE / 1e6:g} MB")
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except UnicodeDecodeError:
        raise ModelError("", "expected a TOML file in UTF-8") from None
    except OSError as error:
        raise ModelError("", f"cannot be read: {error.strerror}") from None
    except tomllib.TOMLDecodeError as error:
        raise ModelError("", f"not valid TOML: {error}") from None
    except RecursionError:
        raise ModelError("", "its tables or arrays are nested too deeply") from None
    return build_scene(table, path.parent)


def build_scene(table: dict[str, Any], folder: Path) -> Scene:
    """Build a scene from a TOML table; file names in it are relative to `folder`."""
    see_texts(table)
    scene = Table(table, "")
    title = scene.take("title", str, default="")
    mesh, dofs = read_mesh(scene, folder)
    kinematics = scene.section("kinematics", Kinematics, optional=True) or Kinematics()
    transient = scene.section("transient", Transient, optional=True)
    fourier = scene.section("fourier", Window, optional=True)
    modal = scene.section("modal", Modal, optional=True)
    harmonic = scene.section("harmonic", Harmonic, optional=True)
    basis = scene.section("basis", Basis, optional=True)
    run = scene.section("run", Run, optional=True) or Run()
    output = scene.section("output", Output, optional=True) or Output()
    horizon = max(transient.duration if transient else 0.0, fourier.length if fourier else 0.0)
    model = replace(read_model(scene, mesh, horizon, folder, output.uplift_group), envelopes=output.envelopes)
    scene.finish()
    for key, group in (("supports", model.supports), ("springs", model.springs), ("probes", model.probes), ("cuts", model.cuts)):
        names = [item.name for item in group]
        for name in names:
            if names.count(name) > 1:
                raise ModelError(key, f"expected different names, {name!r} is there twice")
    if dofs:
        mesh = finer_to(mesh, kinematics, model, dofs)
    return Scene(
        title, with_nodes(mesh, model), model, kinematics, transient, fourier, modal, harmonic, basis, output, run, table,
        folder,
    )
