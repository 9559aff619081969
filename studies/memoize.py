"""Answers about one dataset that its figures, tables and sentences all ask for, computed once."""

import functools
from collections.abc import Callable, Hashable
from typing import Any, Concatenate, ParamSpec, TypeVar

P = ParamSpec("P")
Answer = TypeVar("Answer")

# By function: the data, and answers by the other arguments; not in the closure, which is part of a fingerprint.
_answers: dict[Callable[..., Any], tuple[Any, dict[Hashable, Any]]] = {}


def of_one_dataset(function: Callable[Concatenate[Any, P], Answer]) -> Callable[Concatenate[Any, P], Answer]:
    """The same function, which keeps its answers about one object at a time; neither these nor the data may change."""

    @functools.wraps(function)
    def remembered(data: Any, /, *args: P.args, **kwargs: P.kwargs) -> Answer:
        if _answers.get(function, (None, {}))[0] is not data:
            _answers[function] = data, {}
        answers, key = _answers[function][1], (args, tuple(sorted(kwargs.items())))
        if key not in answers:
            answers[key] = function(data, *args, **kwargs)
        return answers[key]  # type: ignore[no-any-return]

    return remembered
