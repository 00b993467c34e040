"""Progress of long calls."""

from __future__ import annotations

from contextlib import contextmanager
from typing import Any, Callable, Iterator, Union

Told = Callable[[str, int, Union[int, None]], object]
#: What a caller may give: a function, or a class of bars such as ``tqdm.tqdm``.
Callback = Union[Told, type[Any]]


def _tqdm() -> Any:
    try:
        from tqdm.auto import tqdm
    except ImportError:
        raise ImportError(
            "progress=True needs tqdm (pip install tqdm); or give a function progress(stage, done, total)"
        ) from None
    return tqdm


class Bars:
    """A bar of this class of tqdm's for each stage; counts steps where their number is known."""

    def __init__(self, kind: Any) -> None:
        self._kind = kind
        self._bar: Any = None
        self._stage: str | None = None

    def __call__(self, stage: str, done: int, total: int | None) -> None:
        if stage != self._stage or done == 0:
            self.close()
            self._stage = stage
            self._bar = self._kind(desc=stage, total=total, leave=False)
        self._bar.update(done - self._bar.n)

    def close(self) -> None:
        """Ends the last bar."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None


@contextmanager
def told(progress: Callback | bool | None) -> Iterator[Told | None]:
    """The function to tell: none, bars that end with the call, or what was given."""
    has_bars = hasattr(progress, "update") and hasattr(progress, "close")
    if progress is None or progress is False:
        yield None
    elif progress is True or (has_bars and isinstance(progress, type)):
        bars = Bars(_tqdm() if progress is True else progress)
        try:
            yield bars
        finally:
            bars.close()
    elif callable(progress):
        yield progress
    elif has_bars:
        raise TypeError("progress: give tqdm's class, as tqdm.tqdm, or True, and not one bar of it: each stage gets its own")
    else:
        raise TypeError("progress: True, tqdm's class, or a function progress(stage, done, total)")
