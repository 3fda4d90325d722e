"""Rate limits, with a clock that the test advances."""

from manipnet.net.rate_limit import FAULTS_PER_S, MAX_SOURCES, UNKNOWN_PER_S, SourceRateLimiter, Throttle


def test_a_known_source_passes_through_any_flood():
    guard = SourceRateLimiter()
    assert guard.admits("good", 0.0)
    guard.good("good")
    admitted = sum(guard.admits(f"stranger {n}", 0.5) for n in range(50_000))
    assert admitted == UNKNOWN_PER_S - 1
    assert guard.admits("good", 0.5)


def test_one_loud_unknown_source_leaves_room_for_another():
    guard = SourceRateLimiter()
    for _ in range(50_000):
        if guard.admits("loud", 0.1):
            guard.bad("loud")
    assert guard.admits("new", 0.2)


def test_the_budget_is_new_each_second():
    guard = SourceRateLimiter()
    for _ in range(2 * FAULTS_PER_S):
        if guard.admits("loud", 0.0):
            guard.bad("loud")
    assert not guard.admits("loud", 0.9)
    assert guard.admits("loud", 1.0)


def test_a_known_source_that_turns_bad_is_unknown_again():
    guard = SourceRateLimiter()
    guard.good("relay")
    for _ in range(FAULTS_PER_S):
        assert guard.admits("relay", 0.0)
        guard.bad("relay")
    assert not guard.admits("relay", 0.0)
    assert guard.admits("relay", 1.5)
    guard.good("relay")
    assert all(guard.admits("relay", 1.6) for _ in range(2 * UNKNOWN_PER_S))


def test_an_occasional_fault_is_forgiven():
    guard = SourceRateLimiter()
    guard.good("relay")
    for second in range(10 * FAULTS_PER_S):
        assert guard.admits("relay", float(second))
        guard.bad("relay")


def test_memory_is_bounded():
    guard = SourceRateLimiter()
    for n in range(10 * MAX_SOURCES):
        guard.good(n)
        guard.bad(-n)
    assert len(guard._known) <= MAX_SOURCES
    assert len(guard._faults) <= MAX_SOURCES


def test_the_limit_of_a_known_source_does_not_affect_others():
    guard = SourceRateLimiter(known_per_s=1_000)
    for source in ("mad", "sane"):
        guard.admits(source, 0.0)
        guard.good(source)
    for second in range(3):
        assert sum(guard.admits("mad", second + n / 50_000) for n in range(50_000)) <= 1_000
        assert all(guard.admits("sane", second + 0.9) for _ in range(360))


def test_a_throttle_lets_a_burst_pass_and_then_a_steady_rate():
    pace, now = Throttle(per_s=100, burst=10), 5.0
    assert [pace.delay_s(now) for _ in range(10)] == [0.0] * 10
    for _ in range(200):
        now += pace.delay_s(now)
    assert 5.0 + 1.9 < now < 5.0 + 2.1
    assert [pace.delay_s(now + 1.0) for _ in range(10)] == [0.0] * 10
