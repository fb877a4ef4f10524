"""So much at once, and so much a second."""

from denseface.service.runtime.token_bucket import TokenBucket


def test_so_many_at_once_and_so_many_a_second():
    bucket = TokenBucket(3, 0.5, now=10.0)
    assert [bucket.take(10.0) for _ in range(4)] == [True, True, True, False]
    assert not bucket.take(11.9)
    assert bucket.take(12.1)
    assert not bucket.take(12.2)
    assert [bucket.take(1000.0) for _ in range(4)] == [True, True, True, False]


def test_more_may_be_taken_than_there_is_and_comes_back_too():
    bucket = TokenBucket(10, 2, now=0.0)
    bucket.tokens -= 14
    bucket.refill(1.0)
    assert bucket.tokens == -2
