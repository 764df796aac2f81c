"""Where the files of a session lie: found, read once, never outside their folder."""

from dataclasses import dataclass
from pathlib import Path

from calib.errors import InputError
from testbed.files.dialect import SourceFile, Text, read_text

SESSION_FILE = "session.toml"


@dataclass(frozen=True, slots=True, eq=False)
class Sources:
    """The folder of a session, and the files read so far."""

    root: Path
    data: Path | None
    max_mb: float
    texts: dict[Path, Text]

    def text(self, name: str | None, key: str) -> Text:
        """Content of a file named in session.toml, or of DATA; each file is read once."""
        if name is None and self.data is None:
            raise InputError(
                f"[{key}] names no file",
                code="S37",
                where=str(self.root / SESSION_FILE),
                field=f"{key}.file",
                fix=f'write file = "{key}.csv" under [{key}]',
            )
        path = self.data if name is None else self.root / name
        assert path is not None  # one of the two is there
        if name is not None and not path.resolve().is_relative_to(self.root.resolve()):
            raise InputError(
                f'[{key}] file = "{name[:80]}" leads out of the folder',
                code="R6",
                where=str(self.root / SESSION_FILE),
                field=f"{key}.file",
                value=name,
                allowed="a file beside session.toml or in a folder below it",
                fix="copy it there",
            )
        if path not in self.texts:
            where = str(path) if name is None else name
            self.texts[path] = read_text(path, where, max_mb=self.max_mb)
        return self.texts[path]

    @property
    def files(self) -> tuple[SourceFile, ...]:
        """What was read so far."""
        return tuple(text.source for text in self.texts.values())
