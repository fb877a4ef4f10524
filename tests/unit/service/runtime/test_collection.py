import gc

from denseface.service.runtime.collection import collect_from_now_on, collection_put_off


def test_garbage_is_collected_after_the_start_and_not_in_it():
    with collection_put_off():
        assert not gc.isenabled()
    assert gc.isenabled()
    with collection_put_off():
        collect_from_now_on()
        assert gc.isenabled()


def test_who_collects_none_goes_on_so():
    gc.disable()
    try:
        with collection_put_off():
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()
