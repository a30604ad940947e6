"""A translation that lost a field of its template."""

from .translated.press import BrokenPress as BrokenPress
