"""[gear] of session.toml: how many waves a turn the drives may leave."""

from typing import Annotated

from pydantic import Field

from testbed.files.refusal import refusal
from testbed.strict import Strict

Order = Annotated[float, Field(gt=0.0, le=1e6)]
Joint = Annotated[str, Field(max_length=20)]


class GearTable(Strict):
    """[gear]: waves a turn of gears and encoders, joint by joint: ``ratio = { joint1 = 121 }``."""

    ratio: dict[Joint, Order] = Field(default_factory=dict)
    """Turns of the motor for one of the joint, which leave one wave each, and two."""
    orders: dict[Joint, tuple[Order, ...]] = Field(default_factory=dict)
    """Further waves a turn, of stages between or of the lines of an encoder."""

    def of_joints(self, n: int, where: str) -> tuple[tuple[float, ...], ...]:
        """Orders of each of n joints, each once; `where` is the file that states them.

        Raises
        ------
        InputError
            S37: a joint that the robot has not.
        """
        joints = [f"joint{i + 1}" for i in range(n)]
        for key, table in (("ratio", self.ratio), ("orders", self.orders)):
            for name in table:
                if name not in joints:
                    raise refusal(
                        where, f"gear.{key}", f"[gear] {key} names {name}", code="S37",
                        value=name, allowed=f"the joints are joint1 to joint{n}",
                        fix="name joints that the robot has",
                    )  # fmt: skip
        found = []
        for name in joints:
            ratio = (self.ratio[name], 2 * self.ratio[name]) if name in self.ratio else ()
            found.append(tuple(dict.fromkeys([*ratio, *self.orders.get(name, ())])))
        return tuple(found)
