"""Reads a mesh file in a process of its own, with bounded memory, into plain arrays: `python -m uplift.meshes.file_reader FILE OUT`.

FILE ends in .msh (the caller has seen that it begins as one: gmsh runs anything else as a script) or in .med. OUT is an .npz file:
`points` (n, 3) m; `elements.KIND` (m, nodes), indices from 0, for each of gmsh's numbers of element types; `numbers.KIND` (m,), the
group that each row belongs to, where a row is there once for each of its groups and -1 means none; `nodes` and `node_numbers`, nodes of
groups of nodes; `groups`, JSON: [[dimension, number, name], ...]. Nothing is judged here but what cannot be read at all.
"""

from __future__ import annotations

import json
import resource
import sys
from pathlib import Path
from typing import Any

import numpy as np

MEMORY = 4 * 2**30
"""Bytes that reading may take, beside `TIMES` the size of the file."""

TIMES = 200

VERTEX = 15

NODES = {15: 1, 1: 2, 8: 3, 26: 4, 2: 3, 3: 4, 9: 6, 10: 9, 16: 8, 21: 10, 36: 16, 4: 4, 5: 8, 6: 6, 7: 5, 11: 10, 12: 27, 13: 18, 14: 14,
         17: 20, 18: 15, 19: 13}
"""Nodes of an element by gmsh's number of its type."""

MED_KINDS = {"PO1": 15, "SE2": 1, "SE3": 8, "TR3": 2, "TR6": 9, "QU4": 3, "QU8": 16, "QU9": 10, "TE4": 4, "T10": 11, "HE8": 5, "H20": 17,
             "H27": 12, "PE6": 6, "P15": 18, "PY5": 7, "P13": 19}
"""gmsh's number of an element type by MED's name."""

DIMENSIONS = {15: 0, 1: 1, 8: 1, 26: 1, 2: 2, 3: 2, 9: 2, 10: 2, 16: 2, 21: 2, 36: 2}
"""Dimension by gmsh's number of an element type; those that are not here have 3."""

Group = tuple[int, int, str]
"""Dimension, number, name."""


class UnreadableError(Exception):
    """The file is no mesh; the message says why."""


class Elements:
    """Collects elements by type: their nodes and the number of a group, -1 for none."""

    def __init__(self) -> None:
        """Begin with none."""
        self._nodes: dict[int, list[np.ndarray]] = {}
        self._numbers: dict[int, list[np.ndarray]] = {}

    def add(self, kind: int, nodes: np.ndarray, numbers: Any) -> None:
        """Add elements (m, nodes) of one type; `numbers` (m,) or one for all."""
        self._nodes.setdefault(kind, []).append(nodes)
        self._numbers.setdefault(kind, []).append(np.broadcast_to(np.asarray(numbers), len(nodes)))

    def arrays(self, known: np.ndarray) -> dict[str, np.ndarray]:
        """Return the arrays of the file OUT, tags of nodes replaced by their indices in `known` (n,), which is sorted."""
        result = {}
        for kind, parts in self._nodes.items():
            tags = np.concatenate(parts)
            index = np.minimum(np.searchsorted(known, tags), len(known) - 1)
            if not len(known) or np.any(known[index] != tags):
                raise UnreadableError("an element stands on a node that is not there")
            result[f"elements.{kind}"], result[f"numbers.{kind}"] = index, np.concatenate(self._numbers[kind])
        return result


def read_msh2(data: bytes) -> dict[str, np.ndarray]:
    """Read the formats 2.0 to 2.2, in which each element names its group and is there once more for each further one."""
    sections = _sections(data)
    _, binary, size = sections["MeshFormat"].split(b"\n")[0].split()[:3]
    groups: list[Group] = []
    for line in sections.get("PhysicalNames", b"0").splitlines()[1:]:
        dimension, number, name = line.split(None, 2)
        groups.append((int(dimension), int(number), name.strip().strip(b'"').decode("utf-8", "replace")))
    try:
        nodes, elements = sections["Nodes"], sections["Elements"]
    except KeyError as missing:
        raise UnreadableError(f"it has no section ${missing.args[0]}") from None
    if int(binary):
        if int(size) != 8:
            raise UnreadableError("its numbers are not doubles of 8 bytes")
        order = sections["MeshFormat"].split(b"\n", 1)[1][:4]
        tags, points = _binary_nodes(nodes, "<" if order == b"\1\0\0\0" else ">")
        found = _binary_elements(elements, "<" if order == b"\1\0\0\0" else ">")
    else:
        tags, points = _text_nodes(nodes)
        found = _text_elements(elements)
    return _result(tags, points, found, groups)


def _sections(data: bytes) -> dict[str, bytes]:
    """Return what stands between $NAME and $EndNAME, by name."""
    found, at = {}, 0
    while (at := data.find(b"$", at)) >= 0:
        end = data.find(b"\n", at)
        name = data[at + 1 : end].strip() if end >= 0 else b""
        close = data.find(b"$End" + name, end)
        if close < 0 or not name:
            raise UnreadableError(f"its section ${name[:30].decode('utf-8', 'replace')} has no end")
        found[name.decode("utf-8", "replace")] = data[end + 1 : close]
        at = close + 4 + len(name)
    return found


def _count(head: bytes, data: bytes, least: int) -> int:
    """Return the number of entries that a section announces, each of which takes at least so many bytes."""
    count = int(head)
    if not 0 <= count * least <= len(data) + least:
        raise UnreadableError(f"it announces {count} entries and holds fewer")
    return count


def _text_nodes(data: bytes) -> tuple[np.ndarray, np.ndarray]:
    head, _, rest = data.partition(b"\n")
    values = np.array(rest.split(), dtype=float)
    if len(values) != 4 * _count(head, data, 8):
        raise UnreadableError("its nodes are not as many as it announces")
    rows = values.reshape(-1, 4)
    return rows[:, 0].astype(np.int64), rows[:, 1:]


def _text_elements(data: bytes) -> Elements:
    head, _, rest = data.partition(b"\n")
    lines = [line for line in rest.splitlines() if line.strip()]
    if len(lines) != _count(head, data, 4):
        raise UnreadableError("its elements are not as many as it announces")
    rows: dict[tuple[int, int], list[list[bytes]]] = {}
    for line in lines:
        words = line.split()
        rows.setdefault((int(words[1]), int(words[2])), []).append(words)
    elements = Elements()
    for (kind, tags), words_of in rows.items():
        width = _width(kind)
        if any(len(words) != 3 + tags + width for words in words_of):
            raise UnreadableError("an element has too few or too many numbers")
        table = np.array(words_of, dtype=np.int64)
        elements.add(kind, table[:, 3 + tags :], table[:, 3] if tags else -1)
    return elements


def _width(kind: int) -> int:
    if kind not in NODES:
        raise UnreadableError(f"it holds elements of gmsh's type {kind}, which are not known here")
    return NODES[kind]


def _binary_nodes(data: bytes, order: str) -> tuple[np.ndarray, np.ndarray]:
    head, _, rest = data.partition(b"\n")
    count = _count(head, data, 28)
    rows = np.frombuffer(rest, dtype=[("tag", f"{order}i4"), ("at", f"{order}f8", 3)], count=count)
    return rows["tag"].astype(np.int64), np.array(rows["at"], dtype=float)


def _binary_elements(data: bytes, order: str) -> Elements:
    head, _, rest = data.partition(b"\n")
    total, at, elements = _count(head, data, 8), 0, Elements()
    while total > 0:
        kind, count, tags = (int(v) for v in np.frombuffer(rest, dtype=f"{order}i4", count=3, offset=at))
        width = 1 + tags + _width(kind)
        if not (0 < count <= total and tags >= 0 and 4 * count * width <= len(rest) - at - 12):
            raise UnreadableError("its elements are not as many as it announces")
        table = np.frombuffer(rest, dtype=f"{order}i4", count=count * width, offset=at + 12).reshape(count, width).astype(np.int64)
        elements.add(kind, table[:, 1 + tags :], table[:, 1] if tags else -1)
        at, total = at + 12 + 4 * count * width, total - count
    return elements


def read_msh4(path: Path) -> dict[str, np.ndarray]:
    """Read the formats 4.0 and 4.1 by gmsh, in which entities have groups."""
    import gmsh

    gmsh.initialize([], False)
    gmsh.option.setNumber("General.Terminal", 0)
    try:
        gmsh.open(str(path))
    except Exception as error:  # gmsh raises plain exceptions, of a class that differs between releases
        raise UnreadableError(" ".join(str(error).split()) or "gmsh cannot read it") from None
    mesh, elements = gmsh.model.mesh, Elements()
    groups: list[Group] = []
    members: dict[tuple[int, int], list[int]] = {}
    for dimension, number in gmsh.model.getPhysicalGroups():
        groups.append((dimension, number, gmsh.model.getPhysicalName(dimension, number)))
        for entity in gmsh.model.getEntitiesForPhysicalGroup(dimension, number):
            members.setdefault((dimension, int(entity)), []).append(number)
    tags, coordinates, _ = mesh.getNodes()
    for dimension, entity in gmsh.model.getEntities():
        for kind, _, nodes in zip(*mesh.getElements(dimension, entity), strict=True):
            table = np.asarray(nodes, dtype=np.int64).reshape(-1, int(mesh.getElementProperties(kind)[3]))
            for number in members.get((dimension, entity), [-1]):
                elements.add(int(kind), table, number)
    return _result(np.asarray(tags, dtype=np.int64), np.asarray(coordinates).reshape(-1, 3), elements, groups)


def _result(tags: np.ndarray, points: np.ndarray, elements: Elements, groups: list[Group]) -> dict[str, np.ndarray]:
    known, first = np.unique(tags, return_index=True)
    if len(known) < len(tags):
        raise UnreadableError("two nodes have one number")
    return {"points": points[first], **elements.arrays(known), "groups": np.array(json.dumps(groups))}


def read_med(path: Path) -> dict[str, np.ndarray]:
    """Read the first mesh of a MED file, its last step; families without names of groups (GRO) belong to none."""
    import h5py

    with h5py.File(path, "r") as file:
        if "ENS_MAA" not in file or not len(file["ENS_MAA"]):
            raise UnreadableError("it holds no mesh (no ENS_MAA)")
        name = next(iter(file["ENS_MAA"]))
        mesh = file["ENS_MAA"][name]
        if "NOE" not in mesh:
            steps = [step for step in mesh if isinstance(mesh[step], h5py.Group) and "NOE" in mesh[step]]
            if not steps:
                raise UnreadableError("its mesh has no nodes")
            mesh = mesh[steps[-1]]
        limit = path.stat().st_size * TIMES
        count = int(mesh["NOE/COO"].attrs["NBR"])
        if count < 1:
            raise UnreadableError("its mesh has no nodes")
        flat = _stored(mesh["NOE/COO"], limit).reshape(-1, count)  # all X, then all Y
        points = np.zeros((count, 3))
        points[:, : min(len(flat), 3)] = flat[:3].T
        families = _med_groups(file["FAS"][name] if "FAS" in file and name in file["FAS"] else {}, limit)
        numbers = {group: number for number, group in enumerate(sorted({g for names in families.values() for g in names}), start=1)}
        elements, groups = Elements(), set()
        for med, block in mesh["MAI"].items() if "MAI" in mesh else ():
            if med not in MED_KINDS:
                raise UnreadableError(f"it holds elements of MED's type {med}, which are not known here")
            kind = MED_KINDS[med]
            nodes = _stored(block["NOD"], limit).reshape(NODES[kind], -1).T.astype(np.int64) - 1
            family = _stored(block["FAM"], limit).astype(np.int64) if "FAM" in block else np.zeros(len(nodes), dtype=np.int64)
            for value in np.unique(family):
                names = families.get(int(value), [])
                for number in [numbers[group] for group in names] or [-1]:
                    elements.add(kind, nodes[family == value], number)
                groups |= {(DIMENSIONS.get(kind, 3), numbers[group], group) for group in names}
        at = _stored(mesh["NOE/FAM"], limit).astype(np.int64) if "FAM" in mesh["NOE"] else np.zeros(count, dtype=np.int64)
        for value in np.unique(at):
            for group in families.get(int(value), []) if value > 0 else []:
                elements.add(VERTEX, np.flatnonzero(at == value)[:, None], numbers[group])
                groups.add((0, numbers[group], group))
    return _result(np.arange(count), points, elements, sorted(groups))


def _stored(dataset: Any, limit: int) -> np.ndarray:
    """Return the values of a dataset, which may say that it is larger than any memory."""
    if dataset.size * dataset.dtype.itemsize > limit:
        raise UnreadableError("it announces more numbers than it holds")
    return np.asarray(dataset[()]).ravel()


def _med_groups(root: Any, limit: int) -> dict[int, list[str]]:
    """Return the names of the groups of each family by its number."""
    found: dict[int, list[str]] = {}
    for branch in (root[b] for b in ("NOEUD", "ELEME") if b in root):
        for family in branch.values():
            if "GRO" in family and "NOM" in family["GRO"]:
                names = np.asarray(family["GRO/NOM"][()]) if family["GRO/NOM"].size * 80 <= limit else np.zeros((0, 80), dtype=np.int8)
                texts = [np.asarray(row).astype(np.uint8).tobytes().split(b"\0")[0].decode("utf-8", "replace").strip() for row in names]
                found[int(family.attrs["NUM"])] = list(dict.fromkeys(text for text in texts if text))
    return found


def main() -> int:
    """Read the file; a reason why it cannot be read goes to stdout, exit code 1."""
    path, out = Path(sys.argv[1]), Path(sys.argv[2])
    limit = MEMORY + TIMES * path.stat().st_size
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    try:
        if path.suffix == ".med":
            arrays = read_med(path)
        else:
            with path.open("rb") as file:
                head = file.read(2**20)
            version = head[head.index(b"$MeshFormat") + 11 :].split()[0]
            arrays = read_msh2(path.read_bytes()) if version.startswith(b"2") else read_msh4(path)
        np.savez(out, **arrays)
    except MemoryError:
        print("it takes more memory than a file of its size may")
    except UnreadableError as error:
        print(str(error)[:300])
    except Exception as error:  # whatever the libraries raise on a damaged file
        print(f"it is damaged ({' '.join(f'{type(error).__name__}: {error}'.split())[:200]})")
    else:
        return 0
    return 1


if __name__ == "__main__":
    sys.exit(main())
