"""How the package is laid out: which room imports which, how large its parts are, and what a mere import loads."""

import ast
import functools

import pytest

from tests.process import ROOT, finish, start

ROOMS = [
    "drivers.__main__", "drivers.cli", "drivers.commands", "drivers.evidence", "drivers.studies", "drivers.report", "drivers.results",
    "drivers.library", "drivers.analysis", "drivers.scene", "drivers.process", "drivers.petsc_installation", "solvers", "forms", "meshes",
]
"""Each may import itself and what stands after it."""

LINES_OF_A_FILE, LINES_OF_A_FUNCTION, PARAMETERS = 350, 60, 6

LARGE = {
    "meshes/checked.py: quantity, parameters": 9,
    "meshes/panels_gmsh.py: _on_grid, parameters": 7,
    "forms/shells/shell.py: shear, parameters": 8,
    "forms/shells/shell.py: drilling, parameters": 8,
    "solvers/bases/modes.py": 355,
    "solvers/frequency_domain/sweep.py: sweep, parameters": 8,
    "solvers/frequency_domain/sweep.py: _point_solver, parameters": 7,
    "solvers/time_domain/exact/solution.py: from_events, parameters": 8,
    "solvers/time_domain/exact/solution.py: by_collocation, parameters": 7,
    "solvers/time_domain/newmark.py: __init__, parameters": 7,
    "drivers/analysis/long_runs.py: watched, parameters": 7,
    "drivers/library.py: transient, parameters": 7,
}
"""What is larger than that and does not say why, "file" or "file: function", with its lines or parameters; it may only become less."""

HEAVY = {"petsc4py", "slepc4py", "mpi4py", "dolfinx", "gmsh", "scipy", "matplotlib", "h5py", "meshio"}


@functools.cache
def sources():
    """Parsed modules of the package by name, without the name of the package."""
    files = [path for room in ("meshes", "forms", "solvers", "drivers") for path in (ROOT / room).rglob("*.py")]
    names = {".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path for path in files}
    return {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in names.items()}


def imported(module):
    """Names of the modules of the package that a module imports, at its top or inside a function."""
    for node in ast.walk(sources()[module]):
        if isinstance(node, ast.Import):
            targets = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{module}: import by the full name"
            whole = [f"{node.module}.{alias.name}" for alias in node.names]
            targets = [name if name.removeprefix("uplift.") in sources() else node.module for name in whole]
        else:
            continue
        for target in targets:
            if target.startswith("uplift."):
                assert target.removeprefix("uplift.") in sources(), f"{module} imports {target}, which is not there"
                yield target.removeprefix("uplift.")


def room_of(module):
    return next((i for i, room in enumerate(ROOMS) if module == room or module.startswith(f"{room}.")), None)


def test_imports_go_one_way_through_the_rooms():
    assert [name for name in sources() if room_of(name) is None] == ["drivers"]
    upwards = {
        f"{module} imports {target}" for module in sources() if module != "drivers"
        for target in imported(module) if room_of(target) < room_of(module)
    }
    assert not upwards


def test_no_modules_import_each_other_in_a_circle():
    """Those that import nothing but modules taken away before are taken away, until none is left or a circle is."""
    left = {module: set(imported(module)) - {module} for module in sources()}
    while free := {module for module, targets in left.items() if not targets & left.keys()}:
        left = {module: targets for module, targets in left.items() if module not in free}
    assert not left, {module: targets & left.keys() for module, targets in left.items()}


def says(node, words):
    """Whether a docstring has a line that gives the reason."""
    return any(line.strip().startswith(words) for line in (ast.get_docstring(node) or "").splitlines())


def sizes():
    """Pairs of what is too large and its lines or parameters, in the package and its tests."""
    for path in [path for room in ("meshes", "forms", "solvers", "drivers", "tests") for path in sorted((ROOT / room).rglob("*.py"))]:
        name, text = str(path.relative_to(ROOT)), path.read_text(encoding="utf-8")
        tree, lines = ast.parse(text), len(text.splitlines())
        if lines > LINES_OF_A_FILE and not says(tree, "Long because"):
            yield name, lines
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef):
                arguments = node.args
                number = len(arguments.posonlyargs + arguments.args + arguments.kwonlyargs)
                number -= bool(arguments.args) and arguments.args[0].arg in ("self", "cls")
                if node.end_lineno - node.lineno + 1 > LINES_OF_A_FUNCTION and not says(node, "Long because"):
                    yield f"{name}: {node.name}, lines", node.end_lineno - node.lineno + 1
                if number > PARAMETERS and not says(node, "Many parameters because"):
                    yield f"{name}: {node.name}, parameters", number


def test_parts_are_small_or_say_why_not():
    """A reason is a line of the docstring that begins with `Long because` or `Many parameters because`."""
    found = dict(sizes())
    assert {what: size for what, size in found.items() if size > LARGE.get(what, 0)} == {}
    assert sorted(set(LARGE) - set(found)) == [], "these have become small: take them out of the table"


@pytest.mark.parametrize("script", ["import uplift", "from uplift.drivers.cli import main\ntry: main(['--help'])\nexcept SystemExit: pass"])
def test_nothing_heavy_is_loaded_before_it_is_needed(script):
    done = finish(start("-c", f"{script}\nimport sys\nprint(sorted({HEAVY!r} & set(sys.modules)))"))
    assert (done.returncode, done.stdout.splitlines()[-1:], done.stderr) == (0, ["[]"], "")
