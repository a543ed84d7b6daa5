"""Times of work by the clock and in CPU time, and their ratios."""

from __future__ import annotations

from time import sleep

import pytest

from symgrasp.bench.timing import Time, ratios, time_of, times


def test_waiting_takes_no_cpu_time_and_computing_does():
    waited = time_of(lambda: sleep(0.2))
    assert waited.wall >= 0.2 > 10 * waited.cpu
    computed = time_of(lambda: sum(range(10**6)), runs=3)
    assert 0 < computed.cpu <= 1.5 * computed.wall


def test_times_in_a_unit():
    figure = times("a", "ms", [Time(1.0, 0.5), Time(2.0, 0.25)])
    assert (figure.unit, figure.values, figure.cpu) == ("ms", (1000.0, 2000.0), (500.0, 250.0))


def test_ratios_are_those_of_cpu_times():
    figure = ratios("a", [(Time(9.0, 2.0), Time(1.0, 1.0)), (Time(1.0, 3.0), Time(5.0, 4.0))])
    assert (figure.unit, figure.values, figure.cpu) == ("×", pytest.approx((2.0, 0.75)), ())
