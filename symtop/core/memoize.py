"""Answers about one dataset that its figures, tables and sentences all ask for, computed once."""

import functools
from collections.abc import Callable, Hashable
from typing import Any, Concatenate, ParamSpec, TypeVar

P = ParamSpec("P")
Answer = TypeVar("Answer")

# By function: the data, and answers by the other arguments; not in the closure, which is part of a fingerprint.
_answers: dict[Callable[..., Any], tuple[Any, dict[Hashable, Any]]] = {}


def of_one_dataset(function: Callable[Concatenate[Any, P], Answer]) -> Callable[Concatenate[Any, P], Answer]:
    """The same function, which keeps its answers as long as it is asked about the same object, by its other arguments.

    Answers are shared: neither they nor the data may be changed. Another object, equal or not, forgets those before.
    """

    @functools.wraps(function)
    def remembered(data: Any, /, *args: P.args, **kwargs: P.kwargs) -> Answer:
        before, answers = _answers.get(function, (None, {}))
        if data is not before:
            answers = {}
            _answers[function] = data, answers
        key = (args, tuple(sorted(kwargs.items())))
        if key not in answers:
            answers[key] = function(data, *args, **kwargs)
        answer: Answer = answers[key]
        return answer

    return remembered
