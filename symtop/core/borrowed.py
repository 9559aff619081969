"""Arrays that a compiled call reads without counting who holds them.

Numba counts the holders of an array with instructions that wait for the other cores, 5 ns each. A kernel that takes
three views of a table of coefficients does it 20 times a run: 0.1 us, as much as three steps of `strang`.
"""

from numba.core import cgutils
from numba.extending import intrinsic


@intrinsic
def borrowed(typing, array):  # type: ignore[no-untyped-def]
    """The same numbers, uncounted: for an argument, which the caller keeps alive; never to be returned."""

    def emit(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        view = context.make_array(array)(context, builder, arguments[0])
        view.meminfo, view.parent = (cgutils.get_null_value(held.type) for held in (view.meminfo, view.parent))
        return view._getvalue()

    return array(array), emit
