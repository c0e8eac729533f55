"""Work in a copy of this process."""

from __future__ import annotations

import os
import time

import pytest

from legfem.jobs.pool import in_background


@pytest.mark.parametrize("apart", [True, False])
def test_what_is_done_aside_comes_back(apart: bool) -> None:
    known = {"a": 3}
    with in_background(lambda: (os.getpid(), known["a"]), apart) as result:
        time.sleep(0.2)
        process, value = result()
    assert value == 3 and (process != os.getpid()) == apart


def test_what_a_copy_cannot_do_is_done_here() -> None:
    here = os.getpid()

    def work() -> int:
        if os.getpid() != here:
            os._exit(1)
        return 7

    with in_background(work) as result:
        assert result() == 7


def test_an_error_is_raised_here_and_a_copy_does_not_outlive_one() -> None:
    def fail() -> int:
        raise ValueError("made to fail")

    with pytest.raises(ValueError, match="made to fail"), in_background(fail) as result:
        result()
    began = time.monotonic()
    with pytest.raises(KeyError), in_background(lambda: time.sleep(60.0)):
        raise KeyError
    assert time.monotonic() - began < 20.0
