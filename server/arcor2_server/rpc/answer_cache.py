"""Encoded answers, cached as long as their data is unchanged."""

from msgspec import Raw


class AnswerCache:
    """Answers by request; each is valid for one state of its sources, which their revisions stand for."""

    def __init__(self) -> None:
        self._answers: dict[str, tuple[tuple[int, ...], Raw]] = {}

    def get(self, name: str, revisions: tuple[int, ...]) -> Raw | None:
        """Return a cached answer, None if it is outdated."""
        answer = self._answers.get(name)
        return answer[1] if answer is not None and answer[0] == revisions else None

    def store(self, name: str, revisions: tuple[int, ...], encoded: bytes) -> Raw:
        """Keep an encoded answer made from these revisions, taken before its sources were read."""
        answer = Raw(encoded)
        self._answers[name] = (revisions, answer)
        return answer
