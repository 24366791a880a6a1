import pytest

from brachis.apps.view.panel import RATES, Playback, first_rate


@pytest.mark.parametrize(
    "t_end, rate",
    [(10.0, 1.0), (3.0, 1.0), (2.0, 0.5), (0.4, 0.1), (0.001, RATES[0])],
)
def test_a_short_motion_is_slow_at_first(t_end, rate):
    assert first_rate(t_end) == rate


def test_time_goes_on_at_the_rate_and_stops_at_the_end_for_a_while():
    playback = Playback(t_end=1.0, rate=0.5)
    assert playback.advance(0.5) == 0.25
    assert playback.advance(9.0) == 1.0
    assert playback.advance(0.3) == 1.0
    assert playback.advance(0.5) == 0.0
    assert playback.advance(0.2) == pytest.approx(0.1)


def test_a_periodic_motion_goes_on_without_a_pause():
    playback = Playback(t_end=1.0, rate=1.0, loops=True)
    assert [playback.advance(0.6) for _ in range(3)] == [0.6, 1.0, 0.0]


def test_a_motion_that_is_not_repeated_stays_at_its_end_until_it_is_played_again():
    playback = Playback(t_end=1.0, rate=1.0, repeats=False)
    assert [playback.advance(0.6) for _ in range(4)] == [0.6, 1.0, 1.0, 1.0]
    assert not playback.playing
    playback.toggle()
    assert playback.advance(0.25) == 0.25


def test_a_chosen_instant_stays_until_the_motion_is_played_again():
    playback = Playback(t_end=1.0, rate=1.0)
    playback.go_to(0.7)
    assert [playback.advance(0.1), playback.playing] == [0.7, False]
    playback.toggle()
    assert playback.advance(0.1) == pytest.approx(0.8)
    playback.go_to(5.0)
    assert playback.time == 1.0
    playback.toggle()
    assert playback.time == 0.0
