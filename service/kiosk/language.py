"""The name of a language."""

from typing import Annotated

from pydantic import Field

__all__ = ["Language"]

Language = Annotated[str, Field(pattern=r"^[a-z]{2,3}(-[A-Za-z0-9]{2,8})?$")]
"""As in BCP 47."""
