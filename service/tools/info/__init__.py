"""What a file is, told by its contents: faces in every format, frames, recordings, calibrations."""

from denseface.service.tools.info.inspection import Info, inspect
from denseface.service.tools.info.lines import as_lines

__all__ = ["Info", "as_lines", "inspect"]
