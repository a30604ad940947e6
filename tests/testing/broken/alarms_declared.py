"""An alarm without a remedy."""

from .alarming.press import BrokenPress as BrokenPress
