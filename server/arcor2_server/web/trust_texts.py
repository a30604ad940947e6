"""The texts of the page that helps a device to trust the server."""

from pathlib import Path
from typing import Final

import msgspec

from arcor2_hw.data.base import Data


class TrustTexts(Data, frozen=True):
    """The texts in one language. The steps follow the download."""

    title: str
    purpose: str
    compare: str
    download: str
    download_profile: str
    android: str
    android_steps: tuple[str, str]
    ipad: str
    ipad_steps: tuple[str, str]
    desktop: str
    desktop_steps: tuple[str, str]
    then: str
    open_editor: str


TEXTS: Final = msgspec.json.decode(Path(__file__).with_suffix(".json").read_bytes(), type=dict[str, TrustTexts])
"""The texts by language."""
