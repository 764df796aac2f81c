"""The base of file schemas."""

from typing import Annotated, Any, get_args

from pydantic import BaseModel, ConfigDict, Field

PlainText = Annotated[
    str,
    Field(pattern=r"^[^\x00-\x1f\x7f-\x9f\u{2028}-\u{202e}\u{2066}-\u{2069}\u{fffe}\u{ffff}]*$"),
]
"""One line without control characters, of terminals (C0, C1), lines and the direction of writing:
they never reach a terminal, and XML cannot hold them all."""


class Strict(BaseModel):
    """Base of file schemas: no unknown keys, no conversions, no nan."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


def models_in(annotation: Any) -> list[type[Strict]]:
    """Schemas inside an annotation such as ``tuple[A | B, ...]``."""
    if isinstance(annotation, type) and issubclass(annotation, Strict):
        return [annotation]
    return [model for inner in get_args(annotation) for model in models_in(inner)]
