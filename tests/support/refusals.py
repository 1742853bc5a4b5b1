"""What is refused, in one line of a test."""

from collections.abc import Callable
from typing import Any

import pytest


def refused(error: Any, words: str, call: Callable[..., Any], /, *arguments: Any, **options: Any) -> None:
    """The call is an error of its kind, in whose message the words, a regular expression, are found."""
    with pytest.raises(error, match=words):
        call(*arguments, **options)
