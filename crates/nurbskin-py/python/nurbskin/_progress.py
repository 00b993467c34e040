"""Progress of long calls."""

from __future__ import annotations

from contextlib import contextmanager
from typing import Any, Callable, Iterator, Union

Callback = Callable[[str, int, Union[int, None]], object]


class Bars:
    """A bar of tqdm for each stage; counts steps where their number is known."""

    def __init__(self) -> None:
        try:
            from tqdm.auto import tqdm
        except ImportError:
            raise ImportError(
                "progress=True needs tqdm (pip install tqdm); or give a function progress(stage, done, total)"
            ) from None
        self._tqdm = tqdm
        self._bar: Any = None
        self._stage: str | None = None

    def __call__(self, stage: str, done: int, total: int | None) -> None:
        if stage != self._stage or done == 0:
            self.close()
            self._stage = stage
            self._bar = self._tqdm(desc=stage, total=total, leave=False)
        self._bar.update(done - self._bar.n)

    def close(self) -> None:
        """Ends the last bar."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None


@contextmanager
def told(progress: Callback | bool | None) -> Iterator[Callback | None]:
    """The function to tell: none, bars that end with the call, or what was given."""
    if progress is True:
        bars = Bars()
        try:
            yield bars
        finally:
            bars.close()
    elif progress is None or progress is False:
        yield None
    elif callable(progress):
        yield progress
    else:
        raise TypeError("progress: True, or a function progress(stage, done, total)")
