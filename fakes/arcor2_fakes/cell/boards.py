"""The boards of a run, drawn from a seed."""

from __future__ import annotations

import random
from typing import Literal

import msgspec

Defect = Literal["short", "open", "leakage"]
_DEFECTS: tuple[Defect, ...] = ("short", "open", "leakage")
_BAD_SHARE = 0.3
MAX_BOARDS = 1000


class Board(msgspec.Struct, frozen=True):
    """A printed circuit board. It is bad if it has a defect."""

    code: str
    defect: Defect | None = None


def draw_boards(count: int, seed: int) -> list[Board]:
    """Draw boards, the first on top. Of two or more boards, at least one is good and one is bad.

    Codes and defects are independent.
    """
    codes = random.Random(f"codes {seed}").sample(range(10**6), count)
    fate = random.Random(f"defects {seed}")
    defects = [fate.choice(_DEFECTS) if fate.random() < _BAD_SHARE else None for _ in range(count)]
    if count >= 2 and all(defects):
        defects[fate.randrange(count)] = None
    elif count >= 2 and not any(defects):
        defects[fate.randrange(count)] = fate.choice(_DEFECTS)
    return [Board(f"PCB-{code:06d}", defect) for code, defect in zip(codes, defects, strict=True)]
