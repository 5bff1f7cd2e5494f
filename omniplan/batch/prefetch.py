"""Asking for memory ahead of its use, in numba."""

from __future__ import annotations

from typing import Any

from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

__all__ = ["prefetch"]

READ, KEEP, DATA = 0, 3, 1
"""Arguments of LLVM's instruction: to read it, to keep it close, data not code."""


def _prefetch(typing_context: Any, array: Any, index: Any) -> Any:
    """Fetch the cache line of an element; never fails, whatever the index."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = context.make_array(signature.args[0])(context, builder, arguments[0])
        byte, number = ir.IntType(8).as_pointer(), ir.IntType(32)
        address = builder.bitcast(builder.gep(data.data, [arguments[1]]), byte)
        shape = ir.FunctionType(ir.VoidType(), [byte, number, number, number])
        name = "llvm.prefetch.p0"
        fetch = cgutils.get_or_insert_function(builder.module, shape, name)
        how = [ir.Constant(number, value) for value in (READ, KEEP, DATA)]
        builder.call(fetch, [address, *how])
        return context.get_dummy_value()

    return types.void(array, types.int64), emit


prefetch: Any = intrinsic(_prefetch)
"""``prefetch(array, index)``, within kernels only; `index` along a flat array."""
