"""Ctrl-C while machine code runs."""

from __future__ import annotations

import pytest

from mapmeld.slam.interruptible import interruptible


def hidden(cause: BaseException) -> None:
    """Fail as Python does where compiled code returns a result beside an exception."""
    try:
        raise cause
    except BaseException as error:
        raise SystemError("returned a result with an exception set") from error


def test_a_hidden_interruption_comes_out() -> None:
    with pytest.raises(KeyboardInterrupt):
        interruptible(hidden)(KeyboardInterrupt())


def test_also_from_behind_other_errors() -> None:
    def function() -> None:
        try:
            hidden(KeyboardInterrupt())
        except SystemError:
            raise SystemError("another one")  # noqa: B904  (its context is what counts)

    with pytest.raises(KeyboardInterrupt):
        interruptible(function)()


def test_other_errors_stay_as_they_are() -> None:
    with pytest.raises(SystemError, match="returned a result"):
        interruptible(hidden)(ValueError())
    with pytest.raises(ZeroDivisionError):
        interruptible(lambda: 1 // 0)()


def test_results_and_arguments_pass() -> None:
    assert interruptible(divmod)(7, 4) == (1, 3)
