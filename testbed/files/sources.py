"""What a user gave to be read: a session.toml or a table, and the files beside it."""

from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from testbed.files.dialects.blocks import with_block_rows
from testbed.files.dialects.commented_names import with_marked_comments
from testbed.files.dialects.controllers.read import READERS
from testbed.files.dialects.key_values import with_named_numbers
from testbed.files.dialects.marker_names import with_marker_columns
from testbed.files.dialects.numbers import with_bare_numbers, with_exponents
from testbed.files.dialects.quoted import with_quoted_lines, with_row_names
from testbed.files.dialects.records import is_records, read_records
from testbed.files.dialects.squares import with_square_rows
from testbed.files.refusal import how_to_read, no_session, refusal
from testbed.files.session_toml import SESSION_FILE
from testbed.files.visits.tables import CampaignFile
from testbed.gates.kinds import (
    program_of,
    require_kind,
    require_no_program,
    require_no_yaml,
    require_table,
)
from testbed.gates.mistakes import validated
from testbed.gates.paths import is_there, real
from testbed.gates.text import FileText, SourceFile, read_text
from testbed.gates.toml import read_toml_bytes, toml_document
from testbed.gates.workbook import is_workbook, read_workbook
from testbed.units import listed

APPLICATIONS = (".dtx", ".pgx")
"""Endings of the Data and programs of VAL3, which are XML."""


@dataclass(frozen=True, slots=True, eq=False)
class Sources:
    """The folder of a session, and the files read so far."""

    root: Path
    data: Path | None
    max_mb: float
    texts: dict[tuple[Path, str | None], FileText]
    """By file, and sheet of a workbook."""
    toml: str = SESSION_FILE
    """What the session.toml is called in messages."""

    def text(self, name: str | None, key: str, sheet: str | None = None) -> FileText:
        """Content of a file named in session.toml, or of DATA; each file is read once."""
        toml = str(self.root / self.toml)
        if name is None and self.data is None:
            message, fix = f"[{key}] names no file", f'write file = "{key}.csv" under [{key}]'
            raise refusal(toml, f"{key}.file", message, code="S37", fix=fix)
        path = self.data if name is None else self.root / name
        assert path is not None  # one of the two is there
        if (path, sheet) in self.texts:
            return self.texts[path, sheet]
        found = real(path, field=f"[{key}] file", code="R6", where=toml)
        if name is not None and not found.is_relative_to(self.root.resolve()):
            raise refusal(
                toml, f"{key}.file", f'[{key}] file = "{name[:80]}" leads out of the folder',
                code="R6", value=name, allowed="a file beside session.toml or in a folder below it",
                fix="copy it there",
            )  # fmt: skip
        where = str(path) if name is None else name
        text = self.texts[path, sheet] = text_of(path, where, sheet=sheet, max_mb=self.max_mb)
        return text

    def require_data_read(self, toml: str) -> None:
        """Refuse a table that `toml` was to say how to read, while all that was read is its own.

        Raises
        ------
        InputError
            C41: the result would be that of other files.
        """
        if self.data is None or self.data.resolve() in {one.resolve() for one, _ in self.texts}:
            return
        own = sorted({one.name for one, _ in self.texts})
        raise refusal(
            str(self.data), "--config", f"would not be read: {toml} names {listed(own)} itself",
            code="C41", fix=f"take file = out of {toml}, or give {toml} in place of {self.data}",
        )  # fmt: skip

    @property
    def files(self) -> tuple[SourceFile, ...]:
        """What was read so far."""
        return tuple(dict.fromkeys(text.source for text in self.texts.values()))


def text_of(path: Path, where: str, *, sheet: str | None, max_mb: float) -> FileText:
    """Lines of a text file, or of a sheet of a workbook."""
    require_table(path, where)
    if is_workbook(path):
        return with_square_rows(read_workbook(path, where, sheet=sheet, max_mb=max_mb))
    if is_records(path) and path.is_file():
        return read_records(path, where, max_mb=max_mb)
    if sheet is not None:
        message, fix = f'has no sheet "{sheet[:40]}": it is not a workbook', "remove the key sheet"
        raise refusal(where, "sheet", message, code="S37", fix=fix)
    text = read_text(path, where, max_mb=max_mb, markup=path.suffix.lower() in APPLICATIONS)
    text = with_row_names(with_quoted_lines(text))
    require_no_program(text.lines, where, read=tuple(READERS))
    require_no_yaml(text.lines, where)
    if not program_of(text.lines):
        text = with_named_numbers(with_exponents(with_marked_comments(text)))
    return with_square_rows(with_bare_numbers(with_block_rows(with_marker_columns(text))))


@dataclass(frozen=True, slots=True)
class Given:
    """What a user gave to be read: a session.toml, or a table and how it is to be read."""

    file: Path
    toml: Path | None
    """The session.toml, which may be `file` itself."""
    settings: CampaignFile
    sources: Sources
    read: tuple[SourceFile, ...]
    """The session.toml, where there is one."""


def given(data: str | Path, config: str | Path | None, max_mb: float, *, field: str) -> Given:
    """Find what was given and read its session.toml, but no table; `field` is for messages.

    Raises
    ------
    InputError
        As `read_session`.
    """
    file = session_file(Path(data))
    real(file, field=field, code="S37")
    toml = how_to_read(file, config)
    if toml is None:
        return Given(file, None, CampaignFile(), Sources(file.parent, file, max_mb, {}), ())
    content, where = read_toml_bytes(toml, str(toml)), str(toml)
    document = toml_document(content, where)
    require_kind(document, "session", where)
    settings = validated(document, CampaignFile, where)
    table = None if toml == file else file
    sources = Sources(toml.parent, table, max_mb, {}, toml.name)
    return Given(file, toml, settings, sources, (SourceFile(toml, sha256(content).hexdigest()),))


def session_file(path: Path) -> Path:
    """The session.toml of a folder, or the file itself."""
    if not is_there(path, Path.is_dir):
        return path
    if not is_there(path / SESSION_FILE):
        raise no_session(path)
    return path / SESSION_FILE
