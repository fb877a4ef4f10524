"""How property tests choose their examples."""

from hypothesis import settings

# No time limit for one example: a machine that is busy for a moment proves nothing. The same
# examples in every run, so that what passes once passes again; others are looked for with
# `script/test --hypothesis-profile search`.
settings.register_profile("same", deadline=None, derandomize=True)
settings.register_profile("search", deadline=None)
settings.load_profile("same")
