"""Processes are timed and weighed; no figure here depends on how fast the machine is."""

from __future__ import annotations

from symgrasp.bench.maps import processes


def test_a_command_is_timed_and_weighed():
    starting, mapping, memory = processes.commands(1)
    assert 0 < starting.cpu[0] < mapping.cpu[0]
    assert starting.values[0] > 0
    assert 50 < memory.values[0] < 1000


def test_two_processes_at_once():
    clock, cpu = processes.two_at_once(maps=1, rounds=1)
    assert clock.values[0] > 0
    assert 0.5 < cpu.values[0] < 4.0
