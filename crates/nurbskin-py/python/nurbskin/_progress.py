"""Progress of long calls."""

from __future__ import annotations

from typing import Any, Callable, Union

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


def callback_of(progress: Callback | bool | None) -> Callback | None:
    """The function to tell: none, bars, or what was given."""
    if progress is True:
        return Bars()
    if progress is None or progress is False:
        return None
    if callable(progress):
        return progress
    raise TypeError("progress: True, or a function progress(stage, done, total)")
