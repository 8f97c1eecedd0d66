"""Watches over inputs: which of them are there, fresh and understood."""

from collections.abc import Iterable


class InputMonitor:
    """When each input was last good, and what is wrong with those that came bad."""

    def __init__(self, names: Iterable[str], timeout: float):
        """Watch over inputs by name; older than `timeout` [s] is stale."""
        self.timeout = timeout
        self._names = tuple(names)
        self._times: dict[str, float] = {}
        self._errors: dict[str, str] = {}

    def take(self, name: str, now: float) -> None:
        """Note that a good input came."""
        self._times[name] = now
        self._errors.pop(name, None)

    def refuse(self, name: str, error: str) -> None:
        """Note that an input came that cannot be used; it counts until a good one comes."""
        self._errors[name] = error

    def is_fresh(self, name: str, now: float) -> bool:
        """Tell whether an input is there, good and not stale."""
        return name not in self._errors and now - self._times.get(name, -1e9) <= self.timeout

    def find_fault(self, now: float) -> str:
        """Return what is wrong with the inputs, empty where nothing is.

        The same fault has the same words: there are no times in it.
        """
        missing = [name for name in self._names if name not in self._times | self._errors]
        if missing:
            return f"waiting for {', '.join(missing)}"
        wrong = [self._errors[name] for name in self._names if name in self._errors]
        if wrong:
            return "; ".join(wrong)
        stale = [name for name in self._names if not self.is_fresh(name, now)]
        if stale:
            return f"{', '.join(stale)} stale: none for {1e3 * self.timeout:.0f} ms"
        return ""
