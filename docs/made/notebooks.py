"""Pages as notebooks: text between the blocks that are run, and the blocks as cells.

Write them again after a page was edited: ``python -m made.notebooks`` in ``docs/``.
"""

import json
import re
from pathlib import Path

PAGES = ("tutorials/notebook", "tutorials/student", "tutorials/teacher")
DOCS = Path(__file__).parents[1]
BLOCK = re.compile(r"^```\{play\} python\n(?P<code>.*?)^```\n", re.MULTILINE | re.DOTALL)
HIDDEN = re.compile(r"^```\{play\} \w+\n:hidden:\n.*?^```\n", re.MULTILINE | re.DOTALL)
"""What only the build checks."""
COMMANDS = re.compile(r"^```\{play\} sh\n(:\w+:.*\n)*", re.MULTILINE)
OPTION = re.compile(r"\A(:\w+:.*\n)+")
ROLE = re.compile(r"\{\w+\}`(?:[^`<]*<)?/?([^`>]*)>?`")


def cells(page: str) -> list[tuple[str, str]]:
    """Kind and text of each cell of a page: ``markdown`` or ``code``."""
    found, end = [], 0
    page = COMMANDS.sub("```sh\n", HIDDEN.sub("", page))
    for block in BLOCK.finditer(page):
        found.append(("markdown", ROLE.sub(r"`\1`", page[end : block.start()]).strip()))
        found.append(("code", OPTION.sub("", block["code"]).strip()))
        end = block.end()
    found.append(("markdown", ROLE.sub(r"`\1`", page[end:]).strip()))
    return [(kind, text) for kind, text in found if text]


def notebook(page: str) -> str:
    """A page as a notebook of Jupyter, format 4.5, with nothing run yet."""
    document = {
        "cells": [
            {
                "cell_type": kind,
                "id": f"cell-{number}",
                "metadata": {},
                "source": text.splitlines(keepends=True),
                **({"execution_count": None, "outputs": []} if kind == "code" else {}),
            }
            for number, (kind, text) in enumerate(cells(page))
        ],
        "metadata": {
            "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
            "language_info": {"name": "python"},
        },
        "nbformat": 4,
        "nbformat_minor": 5,
    }
    return json.dumps(document, indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    for name in PAGES:
        text = (DOCS / f"{name}.md").read_text(encoding="utf-8")
        (DOCS / f"{name}.ipynb").write_text(notebook(text), encoding="utf-8")
