"""Where joints and readings may stand in rows that no line names."""

from collections.abc import Iterator

from testbed.proposal.data import Found


def layouts(look: Found, n: int) -> Iterator[tuple[str, dict[str, tuple[str, ...]]]]:
    """Where joints, position and rotation may stand in rows without a head, by column number."""
    begin = look.names
    for skip in (0, 1):
        left = look.width - skip
        at = begin + skip

        def columns(start: int, count: int) -> tuple[str, ...]:
            return tuple(str(start + k + 1) for k in range(count))

        if left == n:
            yield "joints", {"joints": columns(at, n)}
        if left == n + 6:  # where it was sent, and beside that where it was seen
            for name, q, p in (
                ("joints first", columns(at, n), columns(at + n + 3, 3)),
                ("joints last", columns(at + 6, n), columns(at + 3, 3)),
            ):
                yield (
                    f"both {skip} seen {name}",
                    {"joints": q, "position": p, "rotation": ()},
                )
        for turns in (0, 3, 4, 9):
            if left == 3 + turns:
                both = {"position": columns(at, 3), "rotation": columns(at + 3, turns)}
                yield "readings", both
            if left in (n + 3 + turns, n + 6 + turns) and left >= n + 3 + turns:
                q, p, r = columns(at, n), columns(at + n, 3), columns(at + n + 3, turns)
                yield (
                    f"both {skip} {turns} joints first",
                    {"joints": q, "position": p, "rotation": r},
                )
                p, r, q = columns(at, 3), columns(at + 3, turns), columns(at + 3 + turns, n)
                yield (
                    f"both {skip} {turns} joints last",
                    {"joints": q, "position": p, "rotation": r},
                )
