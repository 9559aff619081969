"""Vector instructions of full width, for kernels whose loop over lanes is worth them.

Told nothing, LLVM uses half of the 512 bits on most processors that have them (``prefer-256-bit``, for the sake of
code that mixes a few vector instructions into others). A loop that does nothing else takes 1.4 times as long with
half of them. The bits of the results do not depend on the width.
"""

from numba import types
from numba.extending import intrinsic

__all__ = ["wide_vectors"]


@intrinsic
def wide_vectors(typing):  # type: ignore[no-untyped-def]
    """Let the kernel that calls this use 512 bits, where the processor has them; it does nothing when it runs.

    The kernel must call it itself: what is inlined takes the attributes of the function it is inlined into.
    """

    def emit(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        set.add(builder.function.attributes, '"prefer-vector-width"="512"')  # `add` refuses names it does not know
        return context.get_dummy_value()

    return types.void(), emit
