"""What README and docs say: commands run or are at least accepted, tables hold, links resolve, what is named exists."""

import argparse
import re
import shlex
import sys
import tomllib

import pytest

from tests.process import ROOT, finish, launch
from uplift.drivers.cli import parser
from uplift.drivers.evidence.verify import published_values

WRITTEN = [ROOT / "README.md", *(ROOT / "docs" / f"{name}.md" for name in ("theory", "verification", "guide", "architecture"))]
PAGES = sorted({*WRITTEN, *(ROOT / "docs").glob("*.md"), ROOT / "CHANGELOG.md"})

ELSEWHERE = {
    "verify": "tests/drivers/test_verify.py runs it",
    "truncation": "half a minute; tests/drivers/test_modes.py runs it on fewer modes",
    "survey": "minutes; tests/drivers/test_survey.py runs it with --quick",
    "stability": "minutes; tests/drivers/test_stability.py runs it with --quick",
    "pareto": "many minutes; tests/drivers/test_pareto.py runs a slice",
    "scale": "minutes; tests/drivers/test_scaling.py runs its parts",
    "benchmarks": "a minute; tests/drivers/test_benchmarks.py runs a quick selection",
    "cost": "minutes of measurements, whose numbers mean nothing beside other tests",
}
"""Commands that are only parsed here, and why; `make` and `docker` need root or an engine and are parsed too."""

FOREIGN = {"--help", "--user", "--read-only", "--oversubscribe"}
"""Options of other programs, and of argparse."""


def text_of(page):
    return page.read_text(encoding="utf-8")


def blocks(page):
    """The indented code of a page, each block its lines."""
    found, block, before = [], [], ""
    for line in [*text_of(page).splitlines(), ""]:
        if line.startswith("    ") and (block or not before.strip()):
            block.append(line[4:])
        elif block:
            found.append(block)
            block = []
        before = line
    return found


def spans(page):
    return re.findall(r"(?<!`)`([^`\n]+)`(?!`)", text_of(page))


def commands(page):
    launchers = ("/usr/bin/python3", "mpirun", "docker", "make", "mkdir", "cp", "sed")
    lines = [re.sub(r"\s+# .*", "", line) for block in blocks(page) for line in block]
    return [line for line in lines if line.split(" ")[0] in launchers]


def accepted(arguments):
    """Parse the arguments of `python3 -m drivers`; fail as the command line would."""
    try:
        return parser().parse_args(arguments)
    except SystemExit:
        pytest.fail(f"not accepted: {shlex.join(arguments)}")


def subcommands():
    return next(a for a in parser()._actions if isinstance(a, argparse._SubParsersAction)).choices


def of_drivers(command):
    """What follows `-m drivers`, None where the command is something else."""
    words = shlex.split(command)
    at = next((i for i in range(len(words) - 1) if words[i : i + 2] == ["-m", "drivers"]), None)
    return None if at is None else words[at + 2 :]


class Shell:
    """Runs commands in one folder that looks like the repository, each of them once, and keeps what they print."""

    def __init__(self, folder):
        self.folder = folder
        self.printed = {}
        for name in ("drivers", "docs", "forms", "meshes", "solvers", "uplift.py"):
            (folder / name).symlink_to(ROOT / name)

    def run(self, command):
        arguments = of_drivers(command)
        key = shlex.join(arguments) if arguments and not command.startswith("mpirun") else command
        if key in self.printed:
            return
        given = command.replace("/usr/bin/python3", sys.executable)
        if arguments and "--no-plots" in subcommands()[arguments[0]].format_help():
            given += " --no-plots"
        given = given.replace("mpirun ", "mpirun --oversubscribe ")
        done = finish(launch(["bash", "-c", given], cwd=self.folder))
        assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"
        self.printed[key] = done.stdout

    def printed_by(self, arguments):
        """What a command printed, run into a folder of its own if it was not run before, whatever folder that was."""
        for key, printed in self.printed.items():
            if re.sub(r" --out \S+", "", key) == arguments:
                return printed
        command = f"{arguments} --out tables/{len(self.printed)}"
        self.run(f"/usr/bin/python3 -m drivers {command}")
        return self.printed[command]


@pytest.fixture(scope="module")
def shell(tmp_path_factory):
    return Shell(tmp_path_factory.mktemp("repository"))


def displacements(printed):
    """{(pass, t): displacements in m} of what a run prints."""
    rows = [line.split() for line in printed.splitlines()]
    return {(row[0], float(row[1])): [float(v) for v in row[2:]] for row in rows if row and re.fullmatch(r"exact|\d+", row[0])}


def rows(page, columns):
    """The cells of all table rows with so many columns."""
    cells = ([c.strip() for c in line.strip("|").split("|")] for line in text_of(page).splitlines() if line.startswith("|"))
    return [row for row in cells if len(row) == columns]


def same_digits(written, value):
    """Whether a value, rounded to the digits that are written, is what is written."""
    mantissa, _, exponent = written.partition("e")
    unit = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
    return abs(float(written) - value) <= 0.5001 * unit


@pytest.mark.check
@pytest.mark.parametrize("page", WRITTEN, ids=lambda page: page.stem)
def test_commands_run(page, shell):
    for command in commands(page):
        words, arguments = shlex.split(command), of_drivers(command)
        if words[0] == "make":
            assert re.search(rf"^{words[1]}:", text_of(ROOT / "Makefile"), re.MULTILINE), command
        elif words[0] == "docker":
            inside = words[words.index("uplift") + 1 :]
            if "--entrypoint" not in words:
                accepted(inside)
            elif arguments:
                accepted(arguments)
            else:
                assert inside[:2] == ["-m", "pytest"], command
        else:
            if arguments:
                accepted(arguments)
            if not arguments or arguments[0] not in ELSEWHERE:
                shell.run(command)
    if page.name == "README.md":
        assert (shell.folder / "results" / "stronger" / "transient" / "report.html").exists()
        assert (shell.folder / "results" / "compare" / "compare.html").exists()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_commands_between_the_lines_are_accepted(page):
    known, options = subcommands(), set()
    for command in known.values():
        options |= {option for action in command._actions for option in action.option_strings}
    for span in spans(page):
        words = shlex.split(span.replace("COMMAND", "verify"))
        if "-m" in words and "drivers" in words:
            accepted(of_drivers(span.replace("COMMAND", "verify")))
        elif page in WRITTEN and words[0] in known and len(words) > 1:
            accepted(words)
        elif page in WRITTEN and words[0].startswith("--") and "=" not in words[0] and '"' not in span:
            assert words[0] in options | FOREIGN, f"{page.name}: no option {words[0]}"


def test_readme_names_every_command():
    table = " ".join(row[0] for row in rows(WRITTEN[0], 2))
    named = {span.split()[0] for span in re.findall(r"`([^`]+)`", table)}
    assert set(subcommands()) <= named


@pytest.mark.check
@pytest.mark.parametrize("page", WRITTEN[:3], ids=lambda page: page.stem)
def test_table_of_the_reference_case_holds(page, shell):
    checked = 0
    for _, first, second, command in rows(page, 4):
        if command.startswith("`run "):
            last = [values for (_, t), values in displacements(shell.printed_by(command.strip("`"))).items() if t == 2.34][-1]
            assert same_digits(first, last[0]) and same_digits(second, last[1]), command
            checked += 1
    assert checked == {"README": 5, "theory": 0, "verification": 6}[page.stem]


@pytest.mark.check
def test_published_values_stand_beside_those_of_a_run(shell):
    page, scene = ROOT / "docs" / "verification.md", "run drivers/scenes/sdls119a.toml"
    table = {(row[0], int(row[1]), float(row[2]), row[3]): row[4:6] for row in rows(page, 7) if row[3].startswith("P3.")}
    assert len(table) == len(published_values()) == 8
    for method in ("transient", "time-frequency"):
        extra = "" if method == "transient" else " --method time-frequency"
        here = displacements(shell.printed_by(f"{scene}{extra} --iterations 2"))
        for item in (p for p in published_values() if p.method == method):
            printed, ours = table[method, item.pass_number, item.time, item.component]
            assert printed == item.printed
            assert same_digits(ours, here[str(item.pass_number), item.time][item.component == "P3.DY"])


@pytest.mark.check
def test_modelisation_b_holds(shell):
    here = displacements(shell.printed_by("run drivers/scenes/sdls119b.toml"))
    table = [row for row in rows(ROOT / "docs" / "verification.md", 5) if re.fullmatch(r"2\.3\d", row[0])]
    assert len(table) == 4
    for time, number, first, second, share in table:
        values = here[number, float(time)]
        assert same_digits(first, values[0]) and same_digits(second, values[1])
        assert not share or same_digits(share.rstrip(" %"), values[2])


@pytest.mark.check
def test_table_of_time_steps_holds(shell):
    page = ROOT / "docs" / "guide.md"
    command = next(c for c in commands(page) if " study " in c)
    shell.run(command)
    header, *lines = shell.printed[shlex.join(of_drivers(command))].splitlines()
    names = re.split(r"\s{2,}", header.strip())
    study = {line.split()[0]: dict(zip(names, line.split(), strict=True)) for line in lines if len(line.split()) == len(names)}
    table = [row for row in rows(page, 3) if row[0] in study]
    assert len(table) == 4
    for step, displacement, gap in table:
        assert same_digits(displacement, float(study[step]["min P3.DX [m]"]))
        assert same_digits(gap, float(study[step]["largest gap [m]"]))


def test_spread_supports_of_the_guide(comm):
    from uplift.drivers.analysis.assembled_scene import prepare
    from uplift.drivers.scene.scene import build_scene

    scenes = ROOT / "drivers" / "scenes"
    snippet = next(block for block in blocks(ROOT / "docs" / "guide.md") if block[0] == "[[supports]]")
    table = tomllib.loads(text_of(scenes / "sdls119a.toml")) | tomllib.loads("\n".join(snippet))
    with prepare(build_scene(table, scenes), comm) as assembly:
        [bed] = assembly.plate.model.supports
        assert bed.stiffness[1] * bed.factors.sum() == pytest.approx(5 * 1e8, rel=1e-12)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_resolve(page):
    """A page that a command makes and that was not made yet is one that the command would make."""
    made = {parser.get_default("out") for parser in subcommands().values()}
    for target in re.findall(r"\]\(([^)\s]+)\)", text_of(page)):
        name, _, anchor = target.partition("#")
        there = (page.parent / name).resolve() if name else page
        assert there.exists() or (there.is_relative_to(ROOT) and there.relative_to(ROOT) in made), f"{page.name}: {target}"
        if anchor:
            headings = re.findall(r"^#+ (.*)", text_of(there), re.MULTILINE)
            assert anchor in {re.sub(r"[^\w -]", "", h.lower()).replace(" ", "-") for h in headings}, f"{page.name}: {target}"


@pytest.mark.parametrize("page", WRITTEN, ids=lambda page: page.stem)
def test_files_and_names_exist(page):
    folders = ("meshes", "forms", "solvers", "drivers", "tests")
    sources = "\n".join(text_of(path) for folder in folders for path in (ROOT / folder).rglob("*.py"))
    for span in spans(page):
        if re.fullmatch(r"(?!results/)[\w.-]+(/[\w.-]+)+", span) and not span.startswith("/"):
            made = {str(parser.get_default("out")) for parser in subcommands().values()}
            assert (ROOT / span).exists() or span in made, f"{page.name}: {span}"
        elif re.fullmatch(r"sdls[\w-]+\.toml|raft\.toml|box\.toml", span):
            assert (ROOT / "drivers" / "scenes" / span).exists(), span
        elif page.name == "architecture.md" and re.fullmatch(r"[A-Za-z_][\w.]*", span) and not span.endswith((".toml", ".h5")):
            name = span.rsplit(".", 1)[-1]
            assert re.search(rf"\b{name}\b", sources), f"{page.name}: {span}"


def test_one_version_and_one_licence():
    project = tomllib.loads(text_of(ROOT / "pyproject.toml"))["project"]
    citation, licence = text_of(ROOT / "CITATION.cff"), project["license"]["text"]
    assert f"version: {project['version']}\n" in citation and f"license: {licence}\n" in citation
    assert f"## {project['version']}\n" in text_of(ROOT / "CHANGELOG.md")
    assert text_of(ROOT / "LICENSE").startswith(f"{licence} License")


def test_image_and_machine_have_the_same_packages():
    wanted = re.search(r"^PACKAGES = ((?:.*\\\n)*.*)$", text_of(ROOT / "Makefile"), re.MULTILINE)[1]
    installed = re.search(r"install -y --no-install-recommends((?:.*\\\n)*?) &&", text_of(ROOT / "Dockerfile"))[1]
    assert sorted(wanted.replace("\\", "").split()) == sorted(installed.replace("\\", "").split())
