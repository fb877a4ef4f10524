"""The version: hatch reads it for what is built, and the code for what it says.

Not asked of the installed package's metadata: which of its two distributions is installed is no
concern of the code's, and reading them takes time.
"""

__all__ = ["VERSION"]

VERSION = "0.1.0"
