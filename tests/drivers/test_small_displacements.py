"""What is said where an answer is beyond small displacements, of a nearly rigid block on two supports."""

from dataclasses import replace
from math import atan2

import numpy as np

from uplift.drivers.analysis.assembled_scene import Analysis, prepare
from uplift.drivers.analysis.small_displacements import say_large_displacements
from uplift.drivers.scene.scene import build_scene

BLOCK = {
    "mesh": {"width": 2.0, "height": 8.0, "nx": 2, "ny": 8}, "plate": {"young": 3e13, "poisson": 0.0, "density": 2500.0, "thickness": 1.0},
    "gravity": {"acceleration": 9.81}, "probes": [{"name": "TOP", "point": "P3"}], "transient": {"step": 0.01, "duration": 0.05},
    "supports": [{"name": "S", "points": ["P1", "P2"], "stiffness": {"X": 1e9, "Y": 1e9}, "contact": {"X": 1e12, "Y": 1e12}}],
}


def said(comm, caplog, tilt, shift=0.0):
    """What is said of a history in which the right support opens by so many rad times the width, and the probe moves by `shift` m."""
    from uplift.drivers.analysis.analyse import analyse
    from uplift.drivers.scene.request import Request

    caplog.clear()
    with prepare(build_scene(BLOCK, None), comm) as assembly, caplog.at_level("WARNING"):
        analysis = analyse(assembly, Request("transient"))
        assert not caplog.records
        final = analysis.final
        outputs = final.outputs.copy()
        outputs[2, final.layout.layout["probes"]] = shift
        changed = replace(final, gap=np.outer(np.arange(len(final.times)) == 2, [0.0, 2.0 * np.tan(tilt)]), outputs=outputs)
        passes = replace(analysis.passes, histories=[changed])
        say_large_displacements(assembly, Analysis("transient", passes, True))
    return [record.getMessage() for record in caplog.records]


def test_a_block_that_rocks_little_is_not_spoken_of(comm, caplog):
    assert said(comm, caplog, 0.09, 0.5) == []


def test_a_block_beyond_its_overturning_angle_is_no_answer(comm, caplog):
    # Its middle stands 4 m above supports 2 m apart: it falls over beyond atan(1 / 4).
    falls = atan2(1.0, 4.0)
    (words,) = said(comm, caplog, 0.25)
    assert words.startswith("grave: the plate tilts by 0.25 rad") and f"falls over beyond {falls:.3g} rad" in words
    (words,) = said(comm, caplog, 0.24)
    assert words.startswith("doubt: the plate tilts by 0.24 rad") and "a gap is 0.489 m" in words


def test_displacements_of_the_size_of_the_model_are_said_with_the_figure(comm, caplog):
    assert said(comm, caplog, 0.0, 1.0) == ["doubt: a probe moves by 1 m, 0.12 times the extent of the model: beyond small displacements"]
    assert said(comm, caplog, 0.0, -16.0) == ["grave: a probe moves by 16 m, 2 times the extent of the model: beyond small displacements"]
