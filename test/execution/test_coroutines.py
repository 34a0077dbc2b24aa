# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Coroutines that one thread runs, by a clock of the test."""

import math
from threading import Thread

import pytest
from rrth_planner.execution.coroutines import Coroutines, Wait


class World:
    """Coroutines in virtual time."""

    def __init__(self):
        self.now, self.woken = 0.0, 0
        self.coroutines = Coroutines(lambda: self.now, self.wake)

    def wake(self):
        self.woken += 1

    def run_for(self, seconds):
        """Let time pass, from one thing that is due to the next."""
        end = self.now + seconds
        while self.now + self.coroutines.time_left() <= end:
            self.now += self.coroutines.time_left()
            self.coroutines.run()
        self.now = end


@pytest.fixture(name='world')
def _world():
    return World()


def test_coroutines_take_turns_by_what_they_wait_for(world):
    said = []

    async def speak(name, *pauses):
        for pause in pauses:
            said.append((world.now, name))
            await world.coroutines.sleep(pause)
        return name

    ends = [world.coroutines.start(speak('a', 1.0, 3.0)), world.coroutines.start(speak('b', 2.0))]
    assert said == [(0.0, 'a'), (0.0, 'b')]
    world.run_for(1.5)
    assert said[2:] == [(1.0, 'a')]
    assert not ends[1].is_over
    world.run_for(10.0)
    assert [end.result() for end in ends] == ['a', 'b']
    assert world.coroutines.time_left() == math.inf


def test_the_same_events_come_in_the_same_order(world):
    def order_in(world):
        order = []

        async def note(k):
            for _ in range(3):
                await world.coroutines.sleep(0.1)
                order.append(k)

        for k in range(5):
            world.coroutines.start(note(k))
        world.run_for(1.0)
        return order

    assert order_in(world) == order_in(World()) == 3 * [0, 1, 2, 3, 4]


def test_a_pause_of_nothing_lets_others_run_first(world):
    order = []

    async def pause():
        await world.coroutines.sleep(0.0)
        order.append('after')

    world.coroutines.start(pause())
    order.append('before')
    world.coroutines.run()
    assert order == ['before', 'after']

    async def pause_for_ever():
        while True:
            order.append('again')
            await world.coroutines.sleep(0.0)

    world.coroutines.start(pause_for_ever())
    for n in range(1, 4):
        assert order.count('again') == n
        world.coroutines.run()


def test_an_error_is_raised_to_who_waits(world):
    async def fail():
        await world.coroutines.sleep(1.0)
        raise ValueError('of the test')

    async def wait():
        try:
            await world.coroutines.start(fail())
        except ValueError as problem:
            return str(problem)

    end = world.coroutines.start(wait())
    world.run_for(1.0)
    assert end.result() == 'of the test'


def test_a_wait_ends_once_by_its_value_or_by_its_limit(world):
    early, late = Wait(), Wait()

    async def wait_for(wait):
        world.coroutines.limit(wait, 1.0, TimeoutError('too long'))
        return await wait

    ends = [world.coroutines.start(wait_for(wait)) for wait in (early, late)]
    early.give(1)
    world.run_for(2.0)
    assert ends[0].result() == 1
    with pytest.raises(TimeoutError, match='too long'):
        ends[1].result()
    late.give(2)
    with pytest.raises(TimeoutError, match='too long'):
        late.result()


def test_many_may_wait_for_one_thing(world):
    wait, found = Wait(), []

    async def follow(name):
        found.append((name, await wait))

    for name in 'abc':
        world.coroutines.start(follow(name))
    wait.give(7)
    # Who gives a value goes on first, and is woken up for the rest.
    assert not found
    assert world.woken
    world.coroutines.run()
    assert found == [('a', 7), ('b', 7), ('c', 7)]
    assert world.coroutines.start(follow('d')).is_over


def test_another_thread_posts_and_wakes(world):
    wait = Wait()

    async def follow():
        return await wait

    end = world.coroutines.start(follow())
    thread = Thread(target=lambda: world.coroutines.post(lambda: wait.give('posted')))
    thread.start()
    thread.join()
    assert world.woken == 1
    assert not end.is_over
    world.coroutines.run()
    assert end.result() == 'posted'
