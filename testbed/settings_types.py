"""What all tables of a scenario share: the strict base, names, and numbers with their ranges."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Name = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_.-]{0,63}$")]
PlainText = Annotated[str, Field(max_length=4096, pattern=r"^[^\x00-\x1f\x7f]*$")]
Length = Annotated[float, Field(ge=-50_000.0, le=50_000.0)]
Point = tuple[Length, Length, Length]
JointRange = tuple[Length, Length]
"""Lower and upper value of a joint: deg, or mm where it slides."""
Side = Annotated[float, Field(gt=0.0, le=50_000.0)]
Turn = Annotated[float, Field(ge=-720.0, le=720.0)]
RotationVector = tuple[Turn, Turn, Turn]


class Settings(BaseModel):
    """One table of the file: frozen, no unknown keys, no silent conversion, no nan."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)
