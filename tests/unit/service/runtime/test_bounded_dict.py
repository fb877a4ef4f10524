from denseface.service.runtime.bounded_dict import BoundedDict


def test_the_oldest_entry_makes_room():
    entries: BoundedDict[str, int] = BoundedDict(2)
    entries["a"] = 1
    entries["b"] = 2
    entries["a"] = 3  # set anew, it is as old as before
    assert dict(entries) == {"a": 3, "b": 2}
    entries["c"] = 4
    assert dict(entries) == {"b": 2, "c": 4}
