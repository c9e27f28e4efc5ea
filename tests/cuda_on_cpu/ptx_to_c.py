"""Translate Dr.Jit's PTX kernels to C: one function per kernel, run for one thread.

Covers the output of Dr.Jit 1.5 for our kernels; an unknown instruction is an error with its line.
Registers become variables of the same width, predicates bytes. Approximate instructions are computed
exactly. Each thread is a separate warp. (PTX ISA 8.7, https://docs.nvidia.com/cuda/parallel-thread-execution)

python ptx_to_c.py KERNEL.ptx KERNEL.c
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Final

# PTX type -> C type; a register's type by the prefix of its name.
C_TYPES: Final = {
    "pred": "uint8_t", "b8": "uint8_t", "u8": "uint8_t", "s8": "int8_t", "b16": "uint16_t",
    "u16": "uint16_t", "s16": "int16_t", "b32": "uint32_t", "u32": "uint32_t", "s32": "int32_t",
    "b64": "uint64_t", "u64": "uint64_t", "s64": "int64_t", "f32": "float", "f64": "double",
}  # fmt: skip
PREFIXES: Final = {
    "p": "pred", "b": "b8", "w": "b16", "r": "b32", "rd": "b64", "f": "f32", "d": "f64",
}  # fmt: skip
SPECIAL: Final = {
    "%ctaid.x": "ctaid", "%ntid.x": "ntid", "%tid.x": "tid", "%nctaid.x": "nctaid", "%laneid": "0u",
    "%lanemask_lt": "0u", "%lanemask_gt": "0xfffffffeu",
}  # fmt: skip
BINARY: Final = {
    "add": "+", "sub": "-", "mul": "*", "div": "/", "rem": "%", "and": "&", "or": "|", "xor": "^",
}  # fmt: skip
OF_DOUBLES: Final = {"ld", "ldu", "st", "mov", "selp", "setp", *BINARY}  # translated for f64, too
UNARY: Final = {
    "neg": "-({0})", "not": "~({0})", "abs": "fabsf({0})", "sqrt": "sqrtf({0})",
    "rsqrt": "1.0f / sqrtf({0})", "rcp": "1.0f / ({0})", "sin": "sinf({0})", "cos": "cosf({0})",
    "ex2": "exp2f({0})", "lg2": "log2f({0})", "brev": "reversed({0})", "popc": "__builtin_popcount({0})",
    "clz": "({0}) ? __builtin_clz({0}) : 32", "bfind": "({0}) ? __builtin_clz({0}) : 0xffffffffu",
}  # fmt: skip
COMPARISONS: Final = {
    "eq": "==", "ne": "!=", "lt": "<", "le": "<=", "gt": ">", "ge": ">=",
    "lo": "<", "ls": "<=", "hi": ">", "hs": ">=",
}  # fmt: skip
UNORDERED: Final = {"ltu": ">=", "leu": ">", "gtu": "<=", "geu": "<"}  # true also of a NaN
ROUNDED: Final = {"rni": "rintf", "rzi": "truncf", "rmi": "floorf", "rpi": "ceilf"}
HIT: Final = {
    "is_hit": ("hit.is_hit", "u32"), "get_ray_tmax": ("hit.distance", "f32"),
    "get_primitive_idx": ("hit.primitive", "u32"), "get_instance_id": ("hit.instance", "u32"),
    "get_sbt_data_pointer": ("hit.record", "u64"),
}  # fmt: skip
_FIRST_RAY, _AFTER_RAY = 2, 10  # range of traverse's arguments for origin, direction and distances
_SBT_OFFSET, _SBT_STRIDE = 13, 14


class UnknownPtxError(Exception):
    """A line that this translator does not know."""


def c_of_ptx(text: str) -> str:
    """The C source of all kernels of a PTX text. Raises UnknownPtxError."""
    text = re.sub(r"//[^\n]*", "", text)
    parts = ['#include "kernel.h"']
    for match in re.finditer(r"\.entry\s+(\w+)\s*\([^)]*\)\s*\{", text):
        depth, end = 1, match.end()
        while depth:
            depth += {"{": 1, "}": -1}.get(text[end], 0)
            end += 1
        parts.append(_Kernel(match[1]).translated(text[match.end() : end - 1]))
    return "\n".join(parts)


def _groups(pattern: str, text: str) -> tuple[str, ...]:
    """The groups of a pattern that the whole text must match."""
    match = re.fullmatch(pattern, text)
    if match is None:
        raise UnknownPtxError(text)
    return match.groups()


def _operands(text: str) -> list[str]:
    """Operands separated by the commas outside brackets."""
    return [part.strip() for part in re.split(r",(?![^\[({]*[\])}])", text) if part.strip()]


def _with_own_names(code: str) -> str:
    """A body with its inner blocks inlined, their labels and registers renamed."""
    outside: list[str] = []
    inside: list[str] = []
    depth = n_blocks = 0
    for line in code.split("\n"):
        step = {"{": 1, "}": -1}.get(line.strip(), 0)
        depth += step
        if step < 0 and depth == 0:
            n_blocks += 1
            block, inside = "\n".join(inside), []
            labels = set(re.findall(r"^\s*(\w+):", block, re.MULTILINE))
            for label in labels:
                block = re.sub(rf"(?<![%\w.]){label}\b", f"block{n_blocks}_{label}", block)
            names = re.findall(r"%\w+", " ".join(re.findall(r"\.reg[^;]*;", block)))
            for name in sorted(names, key=len, reverse=True):
                # A name that ends in _ represents several numbered ones.
                ends = r"(?=\d|\s*<)" if name.endswith("_") else r"\b"
                block = re.sub(name + ends, f"%block{n_blocks}{name[1:]}", block)
            outside.append(block)
        elif not step:
            (inside if depth else outside).append(line)
    return "\n".join(outside)


class _Kernel:
    """One kernel under translation."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._types: dict[str, str] = {}
        self._arrays: dict[str, str] = {}
        self._lines: list[str] = []
        self._special_forms: dict[str, Callable[[list[str], list[str]], str]] = {
            "ld": self._load, "ldu": self._load, "st": self._store, "red": self._atomic,
            "atom": self._atomic, "setp": self._compare, "cvt": self._convert, "shl": self._shift,
            "shr": self._shift, "call": self._call, "min": self._least, "max": self._least,
        }  # fmt: skip

    def translated(self, code: str) -> str:
        """C of a body."""
        code = _with_own_names(code)
        # A statement ends at its semicolon, a label at its colon.
        code = re.sub(r"^\s*(\w+):", r" label \1;", code, flags=re.MULTILINE)
        for statement in code.split(";"):
            self._statement(" ".join(statement.split()))
        variables = [f"{C_TYPES[t]} {_variable(r)} = 0;" for r, t in self._types.items()]
        body = "\n  ".join([*variables, *self._arrays.values(), *self._lines])
        signature = "const char *params, const struct binding_table *table"
        return (
            f"static void thread_{self._name}({signature}, uint32_t ctaid, uint32_t ntid,"
            f" uint32_t tid, uint32_t nctaid) {{\n  struct hit hit = {{0}};\n  {body}\n}}\n"
            f"void {self._name}({signature}, uint32_t grid, uint32_t block) {{\n"
            f"  run_threads(thread_{self._name}, params, table, grid, block);\n}}"
        )

    def _statement(self, text: str) -> None:
        if not text or text.startswith(".pragma"):
            return
        if text.startswith("label "):
            self._lines.append(f"{text[6:]}: ;")
        elif text.startswith(".reg"):
            kind, names = _groups(r"\.reg\s*\.(\w+)\s+(.*)", text)
            for name in _operands(names):
                if "<" not in name:
                    self._types.setdefault(name, kind)
                    continue
                # %r<9> and the like are declared at their first use.
                stem, n = _groups(r"(%\w+)\s*<(\d+)>", name)
                if stem[1:] not in PREFIXES and stem != "%h":
                    self._types.update({f"{stem}{k}": kind for k in range(int(n))})
        elif text.startswith(".local"):
            kind, name, n = _groups(r"\.local \.align \d+ \.(\w+) (\w+)\[(\d+)\]", text)
            self._arrays[name] = f"{C_TYPES[kind]} {name}[{n}];"
        else:
            self._instruction(text)

    def _instruction(self, text: str) -> None:
        guard = ""
        if match := re.fullmatch(r"@(!?%\w+) (.*)", text):
            guard, text = f"if ({self._value(match[1], 'pred')}) ", match[2]
        name, _, rest = text.partition(" ")
        try:
            line = self._translated(name.split("."), _operands(rest))
        except (KeyError, IndexError, TypeError) as error:
            raise UnknownPtxError(text) from error
        self._lines.append(f"{guard}{{ {line} }}")

    def _translated(self, op: list[str], to: list[str]) -> str:
        name, kind = op[0], op[-1]
        if _is_unknown(op):
            raise KeyError(name)
        if name == "bra":
            return f"goto {to[0]};"
        if name == "ret":
            return "return;"
        if name in self._special_forms:
            return self._special_forms[name](op, to)
        if name in ("activemask", "match"):
            return self._assign(to[0], "1", "b32")
        if name == "shfl":
            lane, _, mask_register = to[0].partition("|")
            return self._assign(lane, self._value(to[1], kind), kind) + self._assign(
                mask_register, "0", "pred"
            )
        if name == "vote":
            return self._assign(to[0], self._value(to[1], "pred"), kind)
        if name in ("mul", "mad") and not kind.startswith("f"):
            return self._integer_product(op, to)
        values = [
            self._value(x, "pred" if name == "selp" and k == 2 else kind)
            for k, x in enumerate(to[1:])
        ]
        return self._assign(to[0], _expression(name, kind, values), kind)

    # Operands.

    def _type(self, register: str) -> str:
        if register not in self._types:
            (prefix,) = _groups(r"%([a-z]+)\d+", register)
            self._types[register] = PREFIXES[prefix]
        return self._types[register]

    def _value(self, operand: str, kind: str) -> str:
        """C of an operand read as a type."""
        if operand.startswith("!"):
            return "!" + self._value(operand[1:], kind)
        if operand in SPECIAL:
            return SPECIAL[operand]
        if operand.startswith("%"):
            return _as_type(_variable(operand), self._type(operand), kind)
        if match := re.fullmatch(r"0[fF]([0-9a-fA-F]{8})", operand):
            return _as_type(f"0x{match[1]}u", "u32", kind)
        if match := re.fullmatch(r"0[dD]([0-9a-fA-F]{16})", operand):
            return _as_type(f"0x{match[1]}ull", "u64", kind)
        if not re.fullmatch(r"-?(0x[0-9a-fA-F]+|\d+)", operand):
            raise UnknownPtxError(operand)
        wide = kind.endswith("64")
        return _as_type(operand + ("ull" if wide else "u"), "u64" if wide else "u32", kind)

    def _assign(self, register: str, expression: str, kind: str) -> str:
        return f"{_variable(register)} = {_as_type(f'({expression})', kind, self._type(register))};"

    def _address(self, operand: str) -> str:
        if match := re.fullmatch(r"\[(%\w+)(?:\+(-?\d+))?\]", operand):
            return f"({self._value(match[1], 'u64')} + {match[2] or 0})"
        if match := re.fullmatch(r"\[params(?:\+(\d+))?\]", operand):
            return f"((uint64_t) params + {match[1] or 0})"
        match = re.fullmatch(r"(\w+)\[(%?\w+)\]", operand)
        if match is None or match[1] not in self._arrays:
            raise UnknownPtxError(operand)
        return f"(uint64_t) &{match[1]}[{self._value(match[2], 'u32')}]"

    # Instructions with a special form.

    def _load(self, op: list[str], to: list[str]) -> str:
        kind, registers = op[-1], _operands(to[0].strip("{}"))
        loads = [
            self._assign(register, f"(({C_TYPES[kind]} *) at)[{k}]", kind)
            for k, register in enumerate(registers)
        ]
        return f"uint64_t at = {self._address(to[1])}; " + " ".join(loads)

    def _store(self, op: list[str], to: list[str]) -> str:
        kind, registers = op[-1], _operands(to[1].strip("{}"))
        stores = [
            f"(({C_TYPES[kind]} *) at)[{k}] = {self._value(register, kind)};"
            for k, register in enumerate(registers)
        ]
        return f"uint64_t at = {self._address(to[0])}; " + " ".join(stores)

    def _atomic(self, op: list[str], to: list[str]) -> str:
        kind, places = op[-1], to if op[0] == "red" else to[1:]
        address, value = (
            f"({C_TYPES[kind]} *) {self._address(places[0])}",
            self._value(places[1], kind),
        )
        action = next((part for part in op[1:] if part in ("add", "or", "and", "exch")), "")
        if not action:
            raise KeyError(op[0])
        if kind == "f32":
            before = {"add": f"add_f32({address}, {value})"}[action]
        else:
            name = "exchange_n" if action == "exch" else f"fetch_{action}"
            before = f"__atomic_{name}({address}, {value}, __ATOMIC_RELAXED)"
        return f"{before};" if op[0] == "red" else self._assign(to[0], before, kind)

    def _compare(self, op: list[str], to: list[str]) -> str:
        how, kind = op[1], op[-1]
        a, b = self._value(to[1], kind), self._value(to[2], kind)
        if how in UNORDERED:
            truth = f"!({a} {UNORDERED[how]} {b})"
        elif how == "neu":
            truth = f"{a} != {b}"
        elif how == "ne" and kind.startswith("f"):
            truth = f"{a} < {b} || {a} > {b}"
        else:
            truth = f"{a} {COMPARISONS[how]} {b}"
        return self._assign(to[0], truth, "pred")

    def _convert(self, op: list[str], to: list[str]) -> str:
        new, old = op[-2:]
        value = self._value(to[1], old)
        for rounding in filter(ROUNDED.get, op):
            value = f"{ROUNDED[rounding]}({value})"
        if old == "f32" and not new.startswith("f"):
            value = f"{ {'u32': 'to_u32', 's32': 'to_s32'}[new] }({value})"
        else:
            value = f"({C_TYPES[new]}) ({value})"
        return self._assign(to[0], value, new)

    def _shift(self, op: list[str], to: list[str]) -> str:
        kind, width = op[-1], int(op[-1][1:])
        value, n = self._value(to[1], kind), self._value(to[2], "u32")
        if kind.startswith("s"):
            return self._assign(to[0], f"({value}) >> ({n} >= {width} ? {width - 1} : {n})", kind)
        shifted = f"({value}) {'<<' if op[0] == 'shl' else '>>'} ({n})"
        return self._assign(to[0], f"{n} >= {width} ? 0 : {shifted}", kind)

    def _integer_product(self, op: list[str], to: list[str]) -> str:
        kind, how = op[-1], next(part for part in op if part in ("lo", "hi", "wide"))
        wide = f"{kind[0]}{2 * int(kind[1:])}"
        a, b = (f"({C_TYPES[wide]}) ({self._value(x, kind)})" for x in to[1:3])
        product, result = f"{a} * {b}", wide
        if how != "wide":
            product = f"({C_TYPES[kind]}) ({product}{' >> ' + kind[1:] if how == 'hi' else ''})"
            result = kind
        more = f" + {self._value(to[3], result)}" if op[0] == "mad" else ""
        return self._assign(to[0], product + more, result)

    def _least(self, op: list[str], to: list[str]) -> str:
        kind = op[-1]
        a, b = (self._value(x, kind) for x in to[1:])
        if kind == "f32":
            return self._assign(to[0], f"{op[0]}_{'nan' if 'NaN' in op else 'num'}({a}, {b})", kind)
        return self._assign(to[0], f"{a} {'<' if op[0] == 'min' else '>'} {b} ? {a} : {b}", kind)

    def _call(self, op: list[str], to: list[str]) -> str:
        results, name, arguments = _operands(to[0].strip("()")), to[1], _operands(to[2].strip("()"))
        if name in ("_optix_get_launch_index_x", "_optix_get_launch_dimension_x"):
            return self._assign(results[0], "tid" if "index" in name else "ntid", "u32")
        query = name.removeprefix("_optix_hitobject_")
        if query == "traverse":
            ray = ", ".join(self._value(x, "f32") for x in arguments[_FIRST_RAY:_AFTER_RAY])
            scene = self._value(arguments[1], "u64")
            records = ", ".join(
                self._value(arguments[k], "u32") for k in (_SBT_OFFSET, _SBT_STRIDE)
            )
            return f"float ray[] = {{{ray}}}; traverse(&hit, table, {scene}, ray, {records});"
        if query == "get_attribute":
            return self._assign(
                results[0], f"hit.attributes[{self._value(arguments[0], 'u32')}]", "u32"
            )
        return self._assign(results[0], *HIT[query])


def _is_unknown(op: list[str]) -> bool:
    """True for a variant of a known instruction that would be translated wrongly."""
    name = op[0]
    return (
        "sat" in op
        or ("f64" in op and name not in OF_DOUBLES and not _is_another_float(op))
        or (name in ("popc", "clz", "brev", "bfind") and op[-1].endswith("64"))
        or (name == "bfind" and "shiftamt" not in op)
        or (name == "setp" and bool(set(op[2:-1]) - {"ftz"}))
    )


def _is_another_float(op: list[str]) -> bool:
    """True if a number changes its precision."""
    return (
        op[0] == "cvt"
        and all(kind.startswith("f") for kind in op[-2:])
        and not set(op) & set(ROUNDED)
    )


def _variable(register: str) -> str:
    return "v_" + register[1:]


def _as_type(value: str, old: str, new: str) -> str:
    """A value of one PTX type converted to another, by bits or by number."""
    if C_TYPES[old] == C_TYPES[new]:
        return value
    if "f" in (old[0], new[0]) and "pred" not in (old, new):
        if new[0] == "f":
            return f"{new}_bits({value})"
        return f"({C_TYPES[new]}) bits_{old}({value})"
    return f"({C_TYPES[new]}) ({value})"


def _expression(name: str, kind: str, values: list[str]) -> str:
    """The C expression of an instruction on values of one type."""
    if name == "mov":
        return values[0]
    if name == "selp":
        return f"{values[2]} ? {values[0]} : {values[1]}"
    if name == "fma":
        return f"fmaf({values[0]}, {values[1]}, {values[2]})"
    if name == "copysign":
        return f"copysignf({values[1]}, {values[0]})"
    if name in ("div", "rem") and not kind.startswith("f"):
        # A GPU does not trap on a division by 0.
        return f"{values[1]} ? {values[0]} {BINARY[name]} {values[1]} : -1"
    if name in BINARY:
        return f"{values[0]} {BINARY[name]} {values[1]}"
    if name == "not" and kind == "pred":
        return f"!{values[0]}"
    if name == "abs" and kind.startswith("s"):
        return f"abs({values[0]})"
    return UNARY[name].format(values[0])


if __name__ == "__main__":
    try:
        Path(sys.argv[2]).write_text(c_of_ptx(Path(sys.argv[1]).read_text()))
    except UnknownPtxError as unknown:
        sys.exit(f"{sys.argv[1]}: not known to ptx_to_c.py: {unknown}")
