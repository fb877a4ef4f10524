"""How fast this machine makes faces, beside a well-known piece of work on the same picture."""

from denseface.service.tools.bench.measuring import Speed, measure_speed, sample_frame
from denseface.service.tools.bench.told import as_json, as_lines

__all__ = ["Speed", "as_json", "as_lines", "measure_speed", "sample_frame"]
