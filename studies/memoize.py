"""A cache of results computed from one dataset, which its figures, tables and sentences all use."""

import functools
from collections.abc import Callable, Hashable
from typing import Any, Concatenate, ParamSpec, TypeVar

P = ParamSpec("P")
Result = TypeVar("Result")

# By function: the data, and results by the other arguments; not in a closure, which is part of a function's hash.
_results: dict[Callable[..., Any], tuple[Any, dict[Hashable, Any]]] = {}


def of_one_dataset(function: Callable[Concatenate[Any, P], Result]) -> Callable[Concatenate[Any, P], Result]:
    """Decorator: cache the results of a function for one dataset at a time; nobody may change them or the data."""

    @functools.wraps(function)
    def remembered(data: Any, /, *args: P.args, **kwargs: P.kwargs) -> Result:
        if _results.get(function, (None, {}))[0] is not data:
            _results[function] = data, {}
        results, key = _results[function][1], (args, tuple(sorted(kwargs.items())))
        if key not in results:
            results[key] = function(data, *args, **kwargs)
        return results[key]  # type: ignore[no-any-return]

    return remembered
