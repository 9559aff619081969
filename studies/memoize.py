"""A cache of results computed from one dataset, which its figures, tables and sentences all use."""

import functools
from collections.abc import Callable, Hashable
from typing import Any, Concatenate, ParamSpec, TypeVar

P = ParamSpec("P")
Answer = TypeVar("Answer")

# By function: the data, and results by the other arguments; not in a closure, which is part of a function's hash.
_answers: dict[Callable[..., Any], tuple[Any, dict[Hashable, Any]]] = {}


def of_one_dataset(function: Callable[Concatenate[Any, P], Answer]) -> Callable[Concatenate[Any, P], Answer]:
    """Decorator: cache the results of a function for one dataset at a time; nobody may change them or the data."""

    @functools.wraps(function)
    def remembered(data: Any, /, *args: P.args, **kwargs: P.kwargs) -> Answer:
        if _answers.get(function, (None, {}))[0] is not data:
            _answers[function] = data, {}
        answers, key = _answers[function][1], (args, tuple(sorted(kwargs.items())))
        if key not in answers:
            answers[key] = function(data, *args, **kwargs)
        return answers[key]  # type: ignore[no-any-return]

    return remembered
