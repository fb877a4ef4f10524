"""Lines for people: what came from outside is escaped, what cannot be said is lost."""

from denseface.service.runtime.terminal._lines import (
    ask,
    can_ask,
    complain,
    complain_of,
    discard_unless_flushed,
    fill_standard_descriptors,
    flush_stdout,
    printable,
    reader_left,
    say,
    stepping_aside,
    suggest,
)

__all__ = [
    "ask", "can_ask", "complain", "complain_of", "discard_unless_flushed",
    "fill_standard_descriptors", "flush_stdout", "printable", "reader_left", "say",
    "stepping_aside", "suggest",
]
