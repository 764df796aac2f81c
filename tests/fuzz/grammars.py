"""Damage by the grammar of a file: plain bytes, TOML and tables of text."""

import re
from collections.abc import Callable
from random import Random

Mutator = Callable[[bytes, Random], bytes]
"""Takes the content of a file and returns it with one change."""

NUMBERS = (
    *("0", "-0.0", "1", "-1", "2", "3", "7", "0.1", "-90", "255", "1000", "1e-12", "1e-300"),
    *("5e-324", "1e9", "1e15", "1e22", "1e100", "-1e300", "1e300", "1e308", "-1.8e308", "1e400"),
    *("nan", "-nan", "inf", "-inf", "2147483648", "9223372036854775808", "9" * 400, "9" * 5000),
    *("1_000", "1,5", "1.234,5", ".5", "5.", "+3", "1e", "--1", "0x1F", "1 2", "1d3", "٣"),
)
TEXTS = (
    *("", " ", "a", "é", "\U0001f916", "a" * 300, "a b", "true", "None", "nan", "A::WORLD", "0"),
    *("\x1b[31m", "\x85", "\u2028", "\x7f", "\ufeff", "\u202e", "=cmd|' /C x'!A0", "@SUM(A1)"),
    *("..", ".", "/", "../../etc/passwd", "/etc/passwd", "/dev/zero", "a/" * 200, "C:\\con"),
    *("http://x/y.stl", "package://p/m.stl", "file:///etc/passwd", "%s%n", "{0}", "{{x}}", "//"),
)
PIECES = (
    *(b",", b";", b"\n", b"\r", b'"', b"'", b"nan", b"-", b"1e999", b"\0", b"\xff", b"[", b"]"),
    *(b"{", b"<", b">", b"&", b"=", b"#", b"0", b"\t", b" ", b"\x1b", b"\xc2\x9b", b"//", b"\xef"),
)
NUMBER = re.compile(rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
QUOTED = re.compile(r"[\x00-\x1f\x7f\"\\]")


def flipped(data: bytes, rng: Random) -> bytes:
    """Some bytes changed, put in, taken out or doubled; or the end cut off."""
    out = bytearray(data)
    for _ in range(rng.randint(1, 4)):
        at, what = rng.randint(0, len(out)), rng.randrange(5)
        if what == 0 and at < len(out):
            out[at] = rng.randrange(256)
        elif what == 1:
            out[at:at] = rng.choice(PIECES)
        elif what == 2:
            del out[at : at + rng.randint(1, 40)]
        elif what == 3:
            out[at:at] = out[at : at + rng.randint(1, 80)]
        elif what == 4 and rng.random() < 0.3:
            out = out[: max(at, 1)]
    return bytes(out)


def renumbered(data: bytes, rng: Random) -> bytes:
    """One number of the file is another one, whatever the grammar."""
    found = list(NUMBER.finditer(data))
    if not found:
        return flipped(data, rng)
    one = rng.choice(found)
    return data[: one.start()] + rng.choice(NUMBERS).encode() + data[one.end() :]


def encoded(data: bytes, rng: Random) -> bytes:
    """The same text in another encoding or with other line ends."""
    text = data.decode("utf-8", "replace")
    return rng.choice(
        (
            lambda: b"\xef\xbb\xbf" + data,
            lambda: text.encode("utf-16"),
            lambda: text.encode("utf-16-be", "surrogatepass"),
            lambda: text.encode("latin-1", "replace"),
            lambda: data.replace(b"\n", b"\r\n"),
            lambda: data.replace(b"\n", b"\r"),
            lambda: b"",
            lambda: b"\n" * 50 + data,
            lambda: data + b"\0" * 20,
            lambda: b"PK\x03\x04" + data,
        )
    )()


def lines_moved(lines: list[str], rng: Random, begins: str) -> list[str]:
    """Lines, or blocks that begin with `begins`, dropped, doubled or swapped."""
    if not lines:
        return lines
    heads = [k for k, line in enumerate(lines) if begins and line.startswith(begins)]
    if heads and rng.random() < 0.4:
        which = rng.randrange(len(heads))
        first = heads[which]
        last = heads[which + 1] if which + 1 < len(heads) else len(lines)
    else:
        first = rng.randrange(len(lines))
        last = min(len(lines), first + rng.choice((1, 1, 1, 2, 5)))
    block, rest = lines[first:last], lines[:first] + lines[last:]
    at = rng.randint(0, len(rest))
    return rng.choice(
        (
            lambda: rest,
            lambda: lines[:last] + block * rng.choice((1, 1, 30)) + lines[last:],
            lambda: rest[:at] + block + rest[at:],
        )
    )()


def toml_values(rng: Random) -> str:
    """A value as TOML has them."""
    deep = rng.choice((2, 20, 200, 2000))
    return rng.choice(
        (
            lambda: rng.choice(NUMBERS),
            lambda: rng.choice(NUMBERS),
            lambda: quoted(rng.choice(TEXTS)),
            lambda: rng.choice(("true", "false", "[]", "{}", "''", '"""\n\n"""', "[[], {}]")),
            lambda: rng.choice(("1979-05-27", "07:32:00", "1979-05-27T07:32:00Z")),
            lambda: f"[{', '.join(rng.choice(NUMBERS) for _ in range(rng.choice((1, 2, 3, 7))))}]",
            lambda: f"[{', '.join(['1.5'] * rng.choice((4, 6, 42, 5000)))}]",
            lambda: f"[{', '.join(quoted(rng.choice(TEXTS)) for _ in range(3))}]",
            lambda: f"[[{rng.choice(NUMBERS)}, 1.0], [2.0]]",
            lambda: "[" * deep + "]" * deep,
            lambda: "{a=" * deep + "1" + "}" * deep,
            lambda: f"{{ a = {rng.choice(NUMBERS)}, name = {quoted(rng.choice(TEXTS))} }}",
            lambda: quoted("x" * rng.choice((201, 5000, 70_000))),
        )
    )()


def quoted(text: str) -> str:
    """Text as a basic string of TOML."""
    return f'"{QUOTED.sub(lambda one: f"{chr(92)}u{ord(one[0]):04x}", text)}"'


def toml_changed(data: bytes, rng: Random) -> bytes:
    """A key, a value, a line or a table of a TOML file changed."""
    lines = data.decode("utf-8", "replace").splitlines()
    keyed = [k for k, line in enumerate(lines) if "=" in line] or [0]
    at = rng.choice(keyed)
    key, _, value = (lines[at] if lines else "").partition("=")
    others = [line.partition("=")[0].strip() for line in lines if "=" in line] or ["a"]
    what = rng.randrange(8)
    if what <= 2:
        lines[at : at + 1] = [f"{key.strip() or 'a'} = {toml_values(rng)}"]
    elif what == 3:
        changed = renumbered(value.encode(), rng).decode("utf-8", "replace")
        lines[at : at + 1] = [f"{key}={changed}"]
    elif what == 4:
        key = rng.choice((key.strip()[:-1], f"{key.strip()}x", rng.choice(others), "a.b", '""'))
        lines[at : at + 1] = [f"{key} = {value}"]
    elif what == 5:
        dotted = ".".join(["a"] * rng.choice((2, 17, 300, 2000)))
        new = rng.choice((rng.choice(others), dotted, quoted(rng.choice(TEXTS)), "unknown"))
        lines.insert(rng.randint(0, len(lines)), f"{new} = {toml_values(rng)}")
    elif what == 6:
        names = [line.strip("[] ") for line in lines if line.startswith("[")] or ["a"]
        name = rng.choice((*names, f"{rng.choice(names)}.{rng.choice(names)}", "unknown", "a.b.c"))
        head = rng.choice((f"[{name}]", f"[[{name}]]"))
        lines.insert(rng.randint(0, len(lines)), head)
    else:
        lines = lines_moved(lines, rng, "[")
    return "\n".join([*lines, ""]).encode("utf-8", "replace")


def table_changed(data: bytes, rng: Random) -> bytes:
    """A cell, row, column, separator or quote of a text table changed."""
    text = data.decode("utf-8", "replace")
    lines = text.split("\n")
    mark = max(",;\t ", key=lambda one: lines[0].count(one) + text.count(one) / len(lines))
    rows = [line.split(mark) for line in lines]
    at = rng.randrange(len(rows))
    column = rng.randrange(max(len(rows[at]), 1))
    what = rng.randrange(10)
    if what <= 2:
        long = rng.choice((201, 5000, 70_000, 140_000))
        new = rng.choice((*NUMBERS, *TEXTS, '"', '""', '"a', "x" * long, "#", "NULL"))
        rows[at][column : column + 1] = [new]
    elif what == 3:
        at = 0 if rng.random() < 0.7 else at
        names = [
            *rows[0],
            *TEXTS,
            "pose_id",
            "q1_deg",
            "q1_rad",
            "x_m",
            "target",
            "temperature_degC",
            "payload_kg",
            "tool",
        ]
        rows[at][column : column + 1] = [rng.choice(names)]
    elif what == 4:
        how = rng.choice(("drop", "double", "swap", "rename"))
        other = rng.randrange(max(len(rows[at]), 1))
        for row in rows:
            if max(column, other) < len(row):
                if how == "drop":
                    del row[column]
                elif how == "double":
                    row.insert(other, row[column])
                elif how == "swap":
                    row[column], row[other] = row[other], row[column]
    elif what == 5:
        new = rng.choice((*NUMBERS, *TEXTS))
        for row in rows[1:]:
            row[column : column + 1] = [new]
    elif what == 6:
        mark = rng.choice((",", ";", "\t", " ", "|", ", ", "  "))
    elif what == 7:
        rows = [[cell.replace(".", ",") for cell in row] for row in rows]
        mark = rng.choice((mark, ";"))
    elif what == 8:
        rows = [[f'"{cell}"' if rng.random() < 0.5 else cell for cell in row] for row in rows]
    else:
        return "\n".join(lines_moved(lines, rng, "")).encode("utf-8", "replace")
    return "\n".join(mark.join(row) for row in rows).encode("utf-8", "replace")
