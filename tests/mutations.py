"""Files with mistakes made in them at random, the same for the same seed."""

import random
import re

NUMBERS = [
    "nan", "inf", "-inf", "0", "-1", "1", "1.5", "1e308", "-1e308", "1e-308", "1" + "0" * 400, "1e9", "1000000000", "-0.0", "1e18",
]
VALUES = [
    *NUMBERS, '""', '"X"', '"text"', '"\\u0000"', '"' + "n" * 300 + '"', '"/dev/zero"', '"."', "true", "[]", "{}", "[[]]", "[1]",
    "[1, 2, 3, 4]",
    "[[0, 0]]", '["P1"]', "1979-05-27", "07:32:00", "{ X = 1 }", "{ Z = nan }", "[nan, nan]", "[1e308, 1e308]", "[1000000, 1000000]",
    '"P1"', '"DBAS"', '"../../etc/passwd"', '"é"',
]
BYTES = [
    b"\x00", b"\xff", b"\n", b"=", b"[", b"]", b"{", b'"', b",", b"#", b"'", b" ", b"\t", b"-", b"9", b"e", b"\xc3\xa9",
    b"\r", b"$",
]
NUMBER = re.compile(rb"(?<![\w.])-?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")


def mutated(data, rng):
    """One to three mistakes in the bytes of a file."""
    ways = [_cut, _drop_line, _double_line, _move_line, _byte, _number, _number, _value, _value, _rename, _truncate]
    for _ in range(rng.choice([1, 1, 2, 3])):
        data = rng.choice(ways)(data, rng)
    return data


def damaged(data, rng):
    """One to three mistakes in a binary file: bits changed, bytes cut out, doubled, zeroed or random, or its end missing."""
    data = bytearray(data)
    for _ in range(rng.choice([1, 1, 2, 3])):
        way, length = rng.randrange(6), rng.randint(1, 64)
        # Half of them near the beginning, where the structure of a file stands.
        at = rng.randrange(min(len(data), rng.choice([4096, len(data)])) + 1)
        if way == 0 and at < len(data):
            data[at] ^= 1 << rng.randrange(8)
        elif way == 1:
            del data[at : at + length]
        elif way == 2:
            data[at:at] = data[at : at + length]
        elif way == 3:
            data[at : at + length] = bytes(len(data[at : at + length]))
        elif way == 4:
            data[at : at + length] = rng.randbytes(len(data[at : at + length]))
        elif rng.random() < 0.3:
            del data[at:]
    return bytes(data)


def _cut(data, rng):
    start = rng.randrange(len(data) + 1)
    return data[:start] + data[start + rng.randint(1, 40):]


def _lines(data):
    return data.splitlines(keepends=True) or [b""]


def _drop_line(data, rng):
    lines = _lines(data)
    del lines[rng.randrange(len(lines))]
    return b"".join(lines)


def _double_line(data, rng):
    lines = _lines(data)
    lines.insert(rng.randrange(len(lines)), rng.choice(lines))
    return b"".join(lines)


def _move_line(data, rng):
    lines = _lines(data)
    line = lines.pop(rng.randrange(len(lines)))
    lines.insert(rng.randrange(len(lines) + 1), line)
    return b"".join(lines)


def _byte(data, rng):
    at = rng.randrange(len(data) + 1)
    return data[:at] + rng.choice(BYTES) + data[at + rng.randint(0, 1):]


def _number(data, rng):
    found = list(NUMBER.finditer(data))
    if not found:
        return data
    here = rng.choice(found)
    return data[: here.start()] + rng.choice(NUMBERS).encode() + data[here.end():]


def _value(data, rng):
    lines = _lines(data)
    assignments = [i for i, line in enumerate(lines) if b"=" in line]
    if not assignments:
        return _number(data, rng)
    i = rng.choice(assignments)
    lines[i] = lines[i].split(b"=")[0] + b"= " + rng.choice(VALUES).encode() + b"\n"
    return b"".join(lines)


def _rename(data, rng):
    words = list(re.finditer(rb"[A-Za-z_]{3,}", data))
    if not words:
        return data
    here, other = rng.choice(words), rng.choice(words)
    return data[: here.start()] + other.group() + data[here.end():]


def _truncate(data, rng):
    return data[: rng.randrange(len(data) + 1)]


def generator(*seed):
    return random.Random("/".join(map(str, seed)))
