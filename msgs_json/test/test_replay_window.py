from __future__ import annotations

import hypothesis.strategies as st
import pytest
from hypothesis import given

from msgs_json.replay_window import WINDOW, ReplayWindow

RESTART = None

# Close together, so that numbers come again, and at the edges of the window and of a boot.
boots = st.sampled_from([0, 1, 2, 2**21 - 1])
numbers = st.builds(lambda boot, count: boot << 32 | count, boots, st.integers(0, 3 * WINDOW))
histories = st.lists(st.just(RESTART) | numbers, max_size=200)


class RememberedNumbers:
    """The window as it is defined: by all that was ever accepted."""

    def __init__(self) -> None:
        self.accepted: set[int] = set()
        self.refused_up_to = -1

    def is_fresh(self, seq: int) -> bool:
        return (
            seq not in self.accepted
            and seq > max(self.accepted, default=-1) - WINDOW
            and seq > self.refused_up_to
        )

    def restart(self) -> None:
        self.refused_up_to = max(self.accepted, default=-1)


@given(history=histories)
def test_window_is_as_defined(history: list[int | None]) -> None:
    window, remembered = ReplayWindow(), RememberedNumbers()
    for seq in history:
        if seq is RESTART:
            window = ReplayWindow(window.highest)
            remembered.restart()
            continue
        assert window.is_fresh(seq) == remembered.is_fresh(seq)
        if window.is_fresh(seq):
            window.accept(seq)
            remembered.accepted.add(seq)
        assert not window.is_fresh(seq)
        assert window.highest == max(remembered.accepted)


@given(history=histories)
def test_every_number_is_accepted_once_at_most(history: list[int | None]) -> None:
    window = ReplayWindow()
    accepted = []
    for seq in history:
        if seq is RESTART:
            window = ReplayWindow(window.highest)
        elif window.is_fresh(seq):
            window.accept(seq)
            accepted.append(seq)
    assert len(accepted) == len(set(accepted))


def test_all_of_the_window_is_accepted_in_any_order_and_nothing_below() -> None:
    window = ReplayWindow()
    window.accept(1000)
    fresh = [seq for seq in range(1001) if window.is_fresh(seq)]
    assert fresh == list(range(1000 - WINDOW + 1, 1000))
    for seq in reversed(fresh):
        window.accept(seq)
    assert not any(window.is_fresh(seq) for seq in range(1001))
    assert window.highest == 1000


def test_after_a_restart_only_what_is_new_is_accepted() -> None:
    window = ReplayWindow(1000)
    assert not any(window.is_fresh(seq) for seq in range(1001))
    window.accept(1010)
    assert [seq for seq in range(1011) if window.is_fresh(seq)] == list(range(1001, 1010))


def test_nothing_was_accepted_at_first() -> None:
    window = ReplayWindow()
    assert window.highest == -1
    assert window.is_fresh(0)
    assert not window.is_fresh(-1)
    assert not window.is_fresh(-WINDOW - 1)


def test_a_step_takes_no_longer_the_larger_it_is() -> None:
    # Shifted by as many bits, the window would fill the memory of any machine.
    window = ReplayWindow()
    window.accept(0)
    window.accept(2**53)
    assert window.is_fresh(2**53 - 1)
    assert not window.is_fresh(0)


def test_the_window_does_not_grow() -> None:
    window = ReplayWindow()
    for seq in range(10_000):
        window.accept(seq)
    assert window._heard.bit_length() == WINDOW


def test_what_is_not_fresh_cannot_be_accepted() -> None:
    window = ReplayWindow()
    window.accept(100)
    for seq in (100, 36):
        with pytest.raises(ValueError, match=f'seq {seq} was accepted before or is 64 or more'):
            window.accept(seq)
    assert window.highest == 100
