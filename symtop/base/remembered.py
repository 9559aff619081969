"""Answers about one dataset that its figures, tables and sentences all ask for, computed once."""

import functools
from collections.abc import Callable, Hashable
from typing import Any, Concatenate, ParamSpec, TypeVar

P = ParamSpec("P")
Answer = TypeVar("Answer")


def of_one_dataset(function: Callable[Concatenate[Any, P], Answer]) -> Callable[Concatenate[Any, P], Answer]:
    """The same function, which keeps its answers as long as it is asked about the same object, by its other arguments.

    Answers are shared: neither they nor the data may be changed. Another object, equal or not, forgets those before.
    """
    last: list[Any] = [None]
    answers: dict[Hashable, Answer] = {}

    @functools.wraps(function)
    def remembered(data: Any, /, *args: P.args, **kwargs: P.kwargs) -> Answer:
        if data is not last[0]:
            answers.clear()
            last[0] = data
        asked = (args, tuple(sorted(kwargs.items())))
        if asked not in answers:
            answers[asked] = function(data, *args, **kwargs)
        return answers[asked]

    return remembered
