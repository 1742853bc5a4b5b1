"""What a call warns of: heard, or not."""

import warnings
from collections.abc import Callable
from typing import Any


def heard(call: Callable[..., Any], *arguments: Any, **options: Any) -> tuple[Any, list[warnings.WarningMessage]]:
    """What a call returns, and all that it warns of."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        result = call(*arguments, **options)
    return result, caught


def told(call: Callable[..., Any], *arguments: Any, **options: Any) -> tuple[Any, list[str]]:
    """The same, in words."""
    result, caught = heard(call, *arguments, **options)
    return result, [str(each.message) for each in caught]


def quiet(call: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
    """What a call returns, whatever it warns of."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return call(*arguments, **options)
