"""Mistakes made at random in tables of joined plates, the same for the same seed, and what becomes of a scene with them."""

import copy
import json
import math
import resource
import signal
import sys
import tomllib
from pathlib import Path

import numpy as np

from tests.mutations import generator
from uplift.drivers.scene.shipped import shipped

SECONDS = 60
KILOBYTES = 500_000
"""What a scene may take more than those before it."""

NUMBERS = [math.nan, math.inf, -1e308, 1e12, 1e9, 1e6, 0, 1e-9, 1e-7, 1e-12, -5, 1, 2, "x", True, {}, []]
NUDGES = [1e-12, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, -1e-6, -1e-3, 0.3, 1, -1]

BED = {"name": "BED", "unilateral": "Z"}
SIDEWAYS = {"stiffness": {"X": 1e7, "Y": 1e7, "Z": 2e7}, "contact": {"X": 1e12, "Y": 1e12, "Z": 1e12}}


def scenes():
    """The box that ships on fewer springs, a flat plate with a notch and a hole beside another, and a wall with a hole on a raft."""
    box = tomllib.loads(shipped()["box"].read_text(encoding="utf-8"))
    box["supports"][0]["grid"]["count"] = [6, 6]
    common = {name: box[name] for name in ("plate", "gravity", "transient")} | {"probes": [{"name": "TOP", "point": "TOP"}]}
    notched = {"size": 1.0, "points": {"TOP": [8, 2]}, "plates": [
        {"name": "A", "corners": [[0, 0], [6, 0], [6, 2], [3, 2], [3, 5], [0, 5]], "holes": [[[1, 1], [2, 1], [2, 2], [1, 2]]]},
        {"name": "B", "corners": [[6, 0], [8, 0], [8, 2], [6, 2]], "edges": ["S", "E", "N", "W"]},
    ]}
    springs = {"stiffness": {"Z": 2e7}, "contact": {"Z": 1e12}, "points": [[0, 0], [8, 0], [0, 5], [8, 2], [3, 2]]}
    flat = common | {"mesh": notched, "supports": [BED | springs]}
    standing = {"size": 1.0, "points": {"TOP": [1, 2, 3]}, "plates": [
        {"name": "A", "corners": [[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]]},
        {"name": "B", "corners": [[1, 2, 0], [3, 2, 0], [3, 2, 2], [1, 2, 3]], "holes": [[[1.5, 2, 0.5], [2.5, 2, 0.5], [2, 2, 1]]]},
    ]}
    wall = common | {"mesh": standing, "supports": [BED | SIDEWAYS | {"points": [[0, 0], [4, 0], [4, 4], [0, 4]]}]}
    return [box, flat, wall]


def mutated_scene(number):
    """A scene with one to three mistakes in its plates."""
    rng = generator("plates", number)
    table = copy.deepcopy(rng.choice(scenes()))
    for _ in range(rng.choice([1, 1, 1, 2, 3])):
        if table["mesh"]["plates"]:
            try:
                rng.choice(WAYS)(table["mesh"], rng)
            except (TypeError, ValueError):
                pass  # an earlier mistake left no numbers to go on with
    return table


def _plate(mesh, rng):
    return rng.choice(mesh["plates"])


def _outline(mesh, rng):
    plate = _plate(mesh, rng)
    return rng.choice([outline for outline in (plate["corners"], *plate.get("holes", [])) if outline] or [[[0, 0]]])


def _number(mesh, rng):
    corner = rng.choice(_outline(mesh, rng))
    corner[rng.randrange(len(corner))] = rng.choice(NUMBERS)


def _nudge(mesh, rng):
    corner = rng.choice(_outline(mesh, rng))
    corner[rng.randrange(len(corner))] += rng.choice(NUDGES)


def _double(mesh, rng):
    outline = _outline(mesh, rng)
    outline.insert(rng.randrange(len(outline) + 1), list(rng.choice(outline)))


def _drop(mesh, rng):
    outline = _outline(mesh, rng)
    outline.pop(rng.randrange(len(outline)))


def _swap(mesh, rng):
    outline = _outline(mesh, rng)
    i, j = rng.randrange(len(outline)), rng.randrange(len(outline))
    outline[i], outline[j] = outline[j], outline[i]


def _reverse(mesh, rng):
    _outline(mesh, rng).reverse()


def _along(mesh, rng):
    """One more corner on an edge, near its end, or beyond it so that the outline goes back."""
    outline = _outline(mesh, rng)
    i, t = rng.randrange(len(outline)), rng.choice([0.5, 0.25, 1e-3, 1e-6, 1e-9, -0.3, 1.5])
    outline.insert(i, [x + t * (y - x) for x, y in zip(outline[i - 1], outline[i], strict=True)])


def _collinear(mesh, rng):
    outline = _outline(mesh, rng)
    i = rng.randrange(len(outline))
    outline[i] = [(x + y) / 2 for x, y in zip(outline[i - 1], outline[(i + 1) % len(outline)], strict=True)]


def _hole(mesh, rng):
    plate = _plate(mesh, rng)
    around = np.array([[*corner, 0][:3] for corner in plate["corners"]], dtype=float)
    middle = around.mean(axis=0)
    first, second, arms = around[0], around[1], around - middle
    holes = {
        "inside": [middle + 0.3 * arms], "outside": [around + 3 * (first - middle)], "across": [around + first - middle], "all": [around],
        "at a corner": [np.vstack([around[:1], middle + 0.2 * arms])], "a line": [np.array([first, middle, 0.5 * (first + middle)])],
        "a point": [np.repeat(middle[None], 3, axis=0)], "tiny": [middle + 1e-8 * arms], "wide": [middle + 0.6 * arms],
        "crossing itself": [(middle + 0.3 * arms)[[0, 2, 1, *range(3, len(around))]]], "twice": [middle + 0.2 * arms] * 2,
        "along an edge": [np.vstack([first + 0.25 * (second - first), first + 0.75 * (second - first), middle])],
    }
    plate.setdefault("holes", []).extend(hole.tolist() for hole in holes[rng.choice(list(holes))])


def _size(mesh, rng):
    mesh["size"] = rng.choice([0, 1e-9, math.nan, 1e9, math.inf, -1, "2", 1e300, 1e-300, 0.01, 0.3, 0.7, 100, 5, True])


def _again(mesh, rng):
    """A plate once more: where it is, beside or above it, on a part of it, far off or at no distance."""
    plate = copy.deepcopy(_plate(mesh, rng))
    plate["name"] += rng.choice(["", "2", "2"])
    axis, by, factor = rng.choice([
        (0, 0.0, 1.0), (0, 0.5, 1.0), (2, 1.0, 1.0), (2, 1e3, 1.0), (2, 1e9, 1.0), (0, 0.0, 0.5),
        *((2, 10.0**-k, 1.0) for k in range(4, 10)),
    ])
    for outline in (plate["corners"], *plate.get("holes", [])):
        for corner in outline:
            corner[:] = [factor * x for x in [*corner, 0][:3]]
            corner[axis] += by
    mesh["plates"].append(plate)


def _cross(mesh, rng):
    corners = rng.choice([
        [[1, -1, -1], [1, 7, -1], [1, 7, 3], [1, -1, 3]], [[0, 0, 0], [4, 4, 0], [4, 4, 4], [0, 0, 4]],
        [[0, 0, 0], [-1, 0, 0], [-1, -1, 0]], [[2, 2, 0], [3, 2, 1], [2, 2, 1]], [[0, 0, -1], [1, 1, -1], [1, 1, 1e-7], [0, 0, 1e-7]],
        [[-1, -1, 0], [9, -1, 0], [9, 9, 0]],
    ])
    mesh["plates"].append({"name": f"X{len(mesh['plates'])}", "corners": corners})


def _less(mesh, rng):
    mesh["plates"].remove(_plate(mesh, rng))


def _edges(mesh, rng):
    plate = _plate(mesh, rng)
    n = len(plate["corners"])
    plate["edges"] = rng.choice([["A"] * n, ["S"] * (n - 1), [""] * n, ["RAFT", "B", "C", "D"], [], [3] * n, "S", [plate["name"]] * n])


def _rename(mesh, rng):
    _plate(mesh, rng)["name"] = rng.choice(["", "A", "RAFT", "S", "RAFT.1", "A.1", "x" * 300, "é", "B\n", 3, "TOP"])


def _points(mesh, rng):
    mesh["points"] = rng.choice([
        {"TOP": [1e9, 0, 0]}, {"TOP": [math.nan, 0]}, {"TOP": [1.5, 1.5, 0]}, {"RAFT": [0, 0]}, {"TOP": [8, 2], "T": [8, 2 + 1e-8]}, {},
        {"TOP": [1, 2, 2.999999]}, [], {"TOP": [0.1234, 0.777, 0]}, {"TOP": [0.3, 0.3, 0]},
    ])


def _cells(mesh, rng):
    mesh.update(rng.choice([{"cell": "triangle"}, {"cell": "hexagon"}, {"cell": 3}, *({"degree": d} for d in (1, 2, 3, 4, 0, "2"))]))


def _dofs(mesh, rng):
    mesh["dofs"] = rng.choice([0, -1, 1, 3000, 100_000, 10**9, 10**18, 1e300, "x"])


def _scale(mesh, rng):
    factor, axes = rng.choice([1e-12, 1e-6, 1e-3, 1e3, 1e6, 1e12]), rng.choice([(0, 1, 2), (0,), (1,), (2,)])
    for plate in mesh["plates"]:
        for outline in (plate["corners"], *plate.get("holes", [])):
            for corner in outline:
                corner[:] = [x * factor if k in axes else x for k, x in enumerate(corner)]
    if len(axes) == 3 and rng.random() < 0.7:
        mesh["size"] *= factor


WAYS = [_number, _nudge, _nudge, _double, _drop, _swap, _reverse, _along, _along, _collinear, _hole, _hole, _hole, _size, _again, _again,
        _cross, _cross, _less, _edges, _rename, _points, _cells, _dofs, _scale]


def slow(number, frame):
    """End what takes too long."""
    raise AssertionError(f"not done in {SECONDS} s of processor time")


def main(numbers):
    """Print a line of JSON for each number: the kilobytes that the scene took, and its result or its error."""
    from mpi4py import MPI

    from uplift.drivers.analysis.analyse import analyse
    from uplift.drivers.analysis.assembled_scene import prepare
    from uplift.drivers.analysis.memory import check_memory
    from uplift.drivers.scene.request import Request
    from uplift.drivers.scene.scene import build_scene
    from uplift.meshes.checked import ModelError
    from uplift.solvers.errors import SolverError

    signal.signal(signal.SIGPROF, slow)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for number in numbers:
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        try:
            scene, request = build_scene(mutated_scene(number), Path()), Request("static")
            request.check(scene)
            check_memory(scene, request, MPI.COMM_SELF, groups=None, limit=0.5 * 2**30)
            with prepare(scene, MPI.COMM_SELF) as assembly:
                line = {"result": bool(np.all(np.isfinite(analyse(assembly, request).final.probes)))}
        except (ModelError, SolverError) as error:
            line = {"error": str(error)}
        signal.setitimer(signal.ITIMER_PROF, 0)
        before, peak = peak, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        print(json.dumps({"number": number, "kB": peak - before} | line), flush=True)


if __name__ == "__main__":
    main([int(argument) for argument in sys.argv[1:]])
