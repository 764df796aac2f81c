"""Where the schema of a file lies, and the line in the file by which editors find it."""

DIRECTIVE = "#:schema"
TITLE = "truebed"
"""How the title of every schema begins: a file that has it may be written again."""


def schema_name(file: str) -> str:
    """How the schema of a file is called where it lies beside it."""
    return f"{file}.schema.json"


def directive(file: str) -> str:
    """The line at the head of a TOML file that tells an editor of the schema beside it."""
    return f"{DIRECTIVE} ./{schema_name(file)}\n"
