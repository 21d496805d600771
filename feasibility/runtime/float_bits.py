"""The bits of a float as an integer and back, for compiled kernels: numba has no such cast."""

from typing import Any, Final

from llvmlite import ir
from numba import types
from numba.extending import intrinsic


def _bits_of(typing_context: Any, value: Any) -> Any:  # noqa: ARG001 (numba's signature)
    """Return the bits of a float as an integer."""

    def cast(context: Any, builder: Any, signature: Any, args: Any) -> Any:  # noqa: ARG001
        return builder.bitcast(args[0], ir.IntType(64))

    return types.int64(types.float64), cast


def _float_of(typing_context: Any, value: Any) -> Any:  # noqa: ARG001 (numba's signature)
    """Return the float that has the bits of an integer."""

    def cast(context: Any, builder: Any, signature: Any, args: Any) -> Any:  # noqa: ARG001
        return builder.bitcast(args[0], ir.DoubleType())

    return types.float64(types.int64), cast


def _bits_of_single(typing_context: Any, value: Any) -> Any:  # noqa: ARG001 (numba's signature)
    """Return the bits of a float in single precision as an integer."""

    def cast(context: Any, builder: Any, signature: Any, args: Any) -> Any:  # noqa: ARG001
        return builder.bitcast(args[0], ir.IntType(32))

    return types.int32(types.float32), cast


def _single_of(typing_context: Any, value: Any) -> Any:  # noqa: ARG001 (numba's signature)
    """Return the float in single precision that has an integer's last 32 bits."""

    def cast(context: Any, builder: Any, signature: Any, args: Any) -> Any:  # noqa: ARG001
        return builder.bitcast(builder.trunc(args[0], ir.IntType(32)), ir.FloatType())

    return types.float32(types.int64), cast


bits_of: Final[Any] = intrinsic(_bits_of)
float_of: Final[Any] = intrinsic(_float_of)
bits_of_single: Final[Any] = intrinsic(_bits_of_single)
single_of: Final[Any] = intrinsic(_single_of)
