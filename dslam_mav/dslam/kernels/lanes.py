"""Eight numbers at a time: a compiled type `Lanes`, so that one kernel works on eight candidates at once.

The compiler finds no vectors by itself in loops as short as K and L. Here a value is eight float64, one of each
candidate, with the arithmetic operators among themselves and with plain numbers; it exists in compiled code only.
Arrays of them are float64 arrays (n, 8), read with `load(array, row)` and written with `store(array, row, lanes)`.
"""

# Numba says what arguments the functions here take, and has no types of its own.
# ruff: noqa: ARG001, ARG002
# mypy: disable-error-code="no-untyped-call"

from __future__ import annotations

import operator
from typing import Any

from llvmlite import ir  # type: ignore[import-untyped]
from numba import njit, types
from numba.core import cgutils
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, register_model

LANES = 8
_DOUBLE = ir.DoubleType()
_VECTOR = ir.VectorType(_DOUBLE, LANES)
_LONGS = ir.VectorType(ir.IntType(64), LANES)
MAX_EXPONENT = 300.0
_LOWEST_EXPONENT = -700.0
_LOG2_E = 1.4426950408889634
_LN2_HIGH, _LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
_FACTORIALS = (39916800.0, 3628800.0, 362880.0, 40320.0, 5040.0, 720.0, 120.0, 24.0, 6.0, 2.0, 1.0, 1.0)
_FLAGS = ("contract", "reassoc", "nsz")


Lanes = Any  # what a compiled function takes and gives: a value of eight float64


class LanesType(types.Type):
    """Type of a value of eight float64."""

    def __init__(self) -> None:
        super().__init__(name=f"Lanes{LANES}")


lanes_type = LanesType()


@register_model(LanesType)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, of_type: Any) -> None:
        super().__init__(manager, of_type, _VECTOR)


def _splat(builder: Any, value: Any) -> Any:
    zero = ir.Constant(ir.IntType(32), 0)
    one = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), value, zero)
    return builder.shuffle_vector(
        one, ir.Constant(_VECTOR, ir.Undefined), ir.Constant(ir.VectorType(ir.IntType(32), LANES), [zero] * LANES)
    )


def _as_lanes(context: Any, builder: Any, value: Any, of_type: Any) -> Any:
    if isinstance(of_type, LanesType):
        return value
    return _splat(builder, context.cast(builder, value, of_type, types.float64))


def _define(op: Any, instruction: str) -> None:
    @infer_global(op)
    class _Template(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            known = all(isinstance(a, (LanesType, types.Float, types.Integer)) for a in args)
            ours = len(args) == 2 and any(isinstance(a, LanesType) for a in args)
            return signature(lanes_type, *args) if known and ours else None

    def _lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        a, b = (_as_lanes(context, builder, v, t) for v, t in zip(args, sig.args, strict=True))
        return getattr(builder, instruction)(a, b, flags=_FLAGS)

    for pair in ((LanesType, LanesType), (LanesType, types.Number), (types.Number, LanesType)):
        lower_builtin(op, *pair)(_lower)


for _op, _name in (
    (operator.add, "fadd"),
    (operator.sub, "fsub"),
    (operator.mul, "fmul"),
    (operator.truediv, "fdiv"),
):
    _define(_op, _name)


def _instruction(function: Any) -> Any:
    """A function that emits the compiler's own instructions."""
    return intrinsic(function)


def _place(context: Any, builder: Any, array_type: Any, array: Any, index: Any) -> Any:
    data = context.make_array(array_type)(context, builder, array).data
    return builder.gep(data, [index])


def _row(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    row = context.cast(builder, args[1], sig.args[1], types.intp)
    place = _place(context, builder, sig.args[0], args[0], builder.mul(row, ir.Constant(ir.IntType(64), LANES)))
    return builder.bitcast(place, _VECTOR.as_pointer())


@_instruction
def load(typingctx: Any, array: Any, row: Any) -> Any:
    """Row `row` of a contiguous float64 array (n, 8)."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.load(_row(context, builder, sig, args), align=8, typ=_VECTOR)

    return lanes_type(array, row), codegen


@_instruction
def store(typingctx: Any, array: Any, row: Any, value: Any) -> Any:
    """Write row `row` of a contiguous float64 array (n, 8); a plain number goes to every lane."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        builder.store(_as_lanes(context, builder, args[2], sig.args[2]), _row(context, builder, sig, args), align=8)
        return context.get_dummy_value()

    return types.void(array, row, value), codegen


@_instruction
def gather(typingctx: Any, table: Any, offset: Any, index: Any) -> Any:
    """table[offset + index] of a contiguous float64 array taken as flat; `index` are lanes of whole numbers."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        start = context.cast(builder, args[1], sig.args[1], types.intp)
        data = _place(context, builder, sig.args[0], args[0], start)
        longs = builder.fptosi(args[2], _LONGS)
        out = ir.Constant(_VECTOR, ir.Undefined)
        for lane in range(LANES):
            at = ir.Constant(ir.IntType(32), lane)
            one = builder.load(builder.gep(data, [builder.extract_element(longs, at)]), typ=_DOUBLE)
            out = builder.insert_element(out, one, at)
        return out

    return lanes_type(table, offset, index), codegen


@_instruction
def splat(typingctx: Any, value: Any) -> Any:
    """The same number in every lane."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _as_lanes(context, builder, args[0], sig.args[0])

    return lanes_type(value), codegen


@_instruction
def where_less(typingctx: Any, a: Any, b: Any, yes: Any, no: Any) -> Any:
    """Lane by lane: `yes` where a < b, else (NaN included) `no`."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        a, b, yes, no = (_as_lanes(context, builder, v, t) for v, t in zip(args, sig.args, strict=True))
        return builder.select(builder.fcmp_ordered("<", a, b), yes, no)

    return lanes_type(a, b, yes, no), codegen


def _unary(name: str) -> Any:
    @_instruction
    def function(typingctx: Any, value: Any) -> Any:
        def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            known = ir.FunctionType(_VECTOR, [_VECTOR])
            inner = cgutils.get_or_insert_function(builder.module, known, f"llvm.{name}.v{LANES}f64")
            return builder.call(inner, args)

        return lanes_type(value), codegen

    return function


square_root = _unary("sqrt")
whole = _unary("floor")


@_instruction
def power_of_two(typingctx: Any, value: Any) -> Any:
    """2 to the power of lanes of whole numbers from −1022 to 1023."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        bias = ir.Constant(_LONGS, [ir.Constant(ir.IntType(64), 1023)] * LANES)
        bits = ir.Constant(_LONGS, [ir.Constant(ir.IntType(64), 52)] * LANES)
        return builder.bitcast(builder.shl(builder.add(builder.fptosi(args[0], _LONGS), bias), bits), _VECTOR)

    return lanes_type(value), codegen


@njit(cache=True, nogil=True, forceinline=True)
def exponential(x: Lanes) -> Lanes:
    """eˣ, good to 1e-14; x is cut to what a float64 can hold."""
    x = where_less(splat(_LOWEST_EXPONENT), x, x, splat(_LOWEST_EXPONENT))
    x = where_less(x, splat(MAX_EXPONENT), x, splat(MAX_EXPONENT))
    n = whole(x * _LOG2_E + 0.5)
    r = (x - n * _LN2_HIGH) - n * _LN2_LOW
    total = splat(1.0 / 479001600.0)
    for factorial in _FACTORIALS:
        total = total * r + 1.0 / factorial
    return total * power_of_two(n)
