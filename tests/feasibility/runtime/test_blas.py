"""Linear algebra on one thread: while somebody is inside, and not longer."""

import threading

import numpy as np
from threadpoolctl import threadpool_info, threadpool_limits

from feasibility.runtime.blas import one_blas_thread


def _threads():
    np.zeros((2, 2)) @ np.zeros((2, 2))
    return {info["num_threads"] for info in threadpool_info() if info["user_api"] == "blas"}


def test_what_was_set_before_returns_when_the_last_has_left():
    with threadpool_limits(2, "blas"):
        before = _threads()
        with one_blas_thread():
            assert _threads() == {1}
            with one_blas_thread():
                assert _threads() == {1}
            assert _threads() == {1}
        assert _threads() == before
        # Some libraries have a single thread, whatever they are told.
        assert 2 in before


def test_threads_that_come_and_go_leave_what_was_set():
    def work():
        for _ in range(200):
            with one_blas_thread():
                pass

    with threadpool_limits(2, "blas"):
        before = _threads()
        others = [threading.Thread(target=work) for _ in range(4)]
        for other in others:
            other.start()
        for other in others:
            other.join()
        assert _threads() == before
