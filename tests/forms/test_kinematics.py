from dataclasses import replace

import numpy as np
import pytest

from tests.conftest import SCENES
from uplift.drivers.analysis.assembled_scene import prepare
from uplift.drivers.scene.scene import read_scene
from uplift.forms.contact.supports import Spring, Support
from uplift.forms.loads.signals import Constant
from uplift.forms.parameters import Force, GroundMotion, PlateModel, Pressure
from uplift.forms.shells.kinematics import Kinematics, choose, degree_of
from uplift.forms.shells.material import Material
from uplift.meshes.checked import ModelError

CONCRETE = Material(3e10, 0.2, 2500.0, 1.0)
BED = Support("B", ((0.0, 0.0),), (0.0, 0.0, 1e7), (0.0, 0.0, 1e9), unilateral="Z")


def shaken(*direction, center=(0.0, 0.0, 0.0)):
    return {"motions": (GroundMotion(direction, Constant(1.0), center),)}


@pytest.mark.parametrize(
    ("model", "flat", "kind"),
    [
        (shaken(1, 0), True, "plane stress"),
        (shaken(0, 0, 0, 0, 0, 1), True, "plane stress"),
        (shaken(0, 0, 1), True, "bending"),
        (shaken(0, 0, 0, 0, 1, 0), True, "bending"),
        (shaken(0, 0, 0, 0, 1, 0, center=(0.0, 0.0, -2.0)), True, "shell"),
        (shaken(1, 0, 1), True, "shell"),
        (shaken(1, 0), False, "shell"),
        ({"gravity": 9.81}, True, "plane stress"),
        ({"gravity": 9.81, "supports": (BED,)}, True, "bending"),
        ({"gravity": 9.81, "up": "Z"}, True, "bending"),
        ({"gravity": 9.81, "supports": (BED,), **shaken(1, 0)}, True, "shell"),
        ({"pressures": (Pressure("p", value=1.0),)}, True, "bending"),
        ({"forces": (Force("f", ((0.0, 0.0),), (0, 0, 0, 0, 0, 1.0)),)}, True, "plane stress"),
        ({"springs": (Spring("s", ((0.0, 0.0),), (1.0, 1.0)),)}, True, "plane stress"),
        ({}, True, "shell"),
    ],
)
def test_what_is_excited_decides(model, flat, kind):
    assert choose(Kinematics(), PlateModel(CONCRETE, **model), flat) == kind


def test_a_stated_kind_has_to_carry_what_acts():
    assert choose(Kinematics("shell"), PlateModel(CONCRETE, **shaken(1, 0)), True) == "shell"
    for kind, model, words in (
        ("bending", shaken(1, 0), "does not move along X"), ("plane stress", shaken(0, 0, 1), "does not move along Z"),
        ("plane stress", {"forces": (Force("f", ((0.0, 0.0),), (0, 0, 0, 0, 0, 1.0)),)}, "along RZ"),
    ):
        with pytest.raises(ModelError, match=words):
            choose(Kinematics(kind), PlateModel(CONCRETE, **model), True)
    with pytest.raises(ModelError, match="expected 'shell'"):
        choose(Kinematics("bending"), PlateModel(CONCRETE), False)


def test_degrees():
    cases = (("plane stress", "triangle", 1), ("shell", "quadrilateral", 2), ("bending", "triangle", 3))
    assert all(degree_of(kind, None, cell) == degree for kind, cell, degree in cases)
    assert degree_of("shell", 1, "quadrilateral") == 1


@pytest.mark.both
def test_no_more_dofs_and_forms_than_a_scene_needs(comm, monkeypatch):
    """Dofs a node by kinematics, and the forms that are compiled: without pressure there is no form for it."""
    from uplift.drivers.analysis import assembled_scene as analysis

    compiled = []
    real = analysis.form_compiler

    def watched(comm):
        compiler = real(comm)

        def compile_it(form):
            compiled.append(form)
            return compiler(form)

        return compile_it

    monkeypatch.setattr(analysis, "form_compiler", watched)
    scene = read_scene(SCENES / "raft.toml")
    nodes = 11 * 11
    pressed = replace(scene.model, pressures=(Pressure("p", value=1.0),))
    for model, kinematics, components, forms in (
        (scene.model, Kinematics(), ("DZ", "DRX", "DRY"), 2),
        (pressed, Kinematics(), ("DZ", "DRX", "DRY"), 3),
        (scene.model, Kinematics("shell"), ("DX", "DY", "DZ", "DRX", "DRY"), 2),
    ):
        compiled.clear()
        with prepare(replace(scene, model=model, kinematics=kinematics), comm) as assembly:
            assert assembly.plate.components == components
            assert assembly.operators.n == nodes * len(components) + 121
            assert len(compiled) == forms


@pytest.mark.ranks
def test_sdls119_as_a_shell_gives_the_same_digits(comm, sdls119a):
    from uplift.drivers.analysis.analyse import analyse
    from uplift.drivers.scene.request import Request

    histories = []
    for scene in (sdls119a, read_scene(SCENES / "sdls119-shell.toml")):
        with prepare(scene, comm) as assembly:
            histories.append(analyse(assembly, Request("transient")).final)
            names = assembly.operators.probes.names
            dofs = assembly.operators.n
    # 45 nodes with DX, DY, DRX (DZ and DRY are imposed, a flat plate has no DRZ) and ten dofs of joints.
    assert dofs == 45 * 3 + 10
    assert names == ("P3.DX", "P3.DY", "P3.DZ")
    plane, shell = (h.probes for h in histories)
    assert np.max(np.abs(shell[:, :2] - plane)) < 1e-12 * np.max(np.abs(plane))
    assert np.all(shell[:, 2] == 0)
