"""Dr.Jit's PTX kernels become equivalent C."""

from __future__ import annotations

import re

import pytest

from tests.cuda_on_cpu.ptx_to_c import UnknownPtxError, c_of_ptx


def lines_of(*statements: str) -> list[str]:
    """The lines of C for the statements, without declarations."""
    body = "\n".join(f"    {statement}" for statement in statements)
    code = c_of_ptx(f".entry drjit_0(.param .align 8 .b8 params[16]) {{\n{body}\n}}")
    return [line.strip() for line in code.split("\n") if re.match(r"  (\{|if|\w+: ;)", line)]


@pytest.mark.parametrize(
    ("ptx", "c"),
    [
        ("add.ftz.f32 %f1, %f2, %f3;", "{ v_f1 = (v_f2 + v_f3); }"),
        ("mov.b32 %f1, 0x3f800000;", "{ v_f1 = f32_bits((0x3f800000u)); }"),
        ("mov.b32 %r1, %f2;", "{ v_r1 = ((uint32_t) bits_f32(v_f2)); }"),
        ("selp.b32 %f1, %f2, %f3, %p4;", "v_p4 ? "),
        ("setp.ne.f32 %p1, %f2, %f3;", "{ v_p1 = (v_f2 < v_f3 || v_f2 > v_f3); }"),
        ("max.ftz.NaN.f32 %f1, %f2, %f3;", "{ v_f1 = (max_nan(v_f2, v_f3)); }"),
        ("shr.u32 %r1, %r2, %r3;", "{ v_r1 = (v_r3 >= 32 ? 0 : (v_r2) >> (v_r3)); }"),
        ("cvt.rzi.u32.f32 %r1, %f2;", "{ v_r1 = (to_u32(truncf(v_f2))); }"),
        ("mad.wide.u32 %rd1, %r2, 4, %rd3;", "(uint64_t) (v_r2) * (uint64_t) (4u) + v_rd3"),
        ("@!%p1 bra l_done;", "if (!v_p1) { goto l_done; }"),
        ("ld.param.u64 %rd4, [params+8];", "uint64_t at = ((uint64_t) params + 8);"),
        ("red.global.add.u32 [%rd3+0], %r1;", "__atomic_fetch_add((uint32_t *) (v_rd3 + 0), v_r1"),
        ("div.u32 %r1, %r2, %r3;", "{ v_r1 = (v_r3 ? v_r2 / v_r3 : -1); }"),
    ],
)
def test_an_instruction_becomes_a_line(ptx: str, c: str) -> None:
    (line,) = lines_of(ptx)
    assert c in line


def test_four_numbers_are_loaded_from_one_place() -> None:
    (line,) = lines_of("ld.global.nc.v4.b32 {%f1, %f2, %r3, %f4}, [%rd5];")
    assert re.findall(r"v_(\w+) = .*?\[(\d)\]", line) == [
        ("f1", "0"),
        ("f2", "1"),
        ("r3", "2"),
        ("f4", "3"),
    ]


def test_blocks_have_separate_labels_and_registers() -> None:
    block = ["{", ".reg .u32 %q;", "mov.u32 %q, %r1;", "bra done;", "done:", "}"]
    lines = lines_of(*block, *block)
    assert [line for line in lines if line.endswith(": ;")] == ["block1_done: ;", "block2_done: ;"]
    assert "v_block1q = v_r1" in lines[0].replace("(", "").replace(")", "")
    assert sum("goto block2_done" in line for line in lines) == 1


def test_a_ray_carries_origin_direction_and_distances() -> None:
    arguments = ", ".join(["%u_z", "%rd1", *[f"%f{k}" for k in range(2, 11)], *["%r1"] * 5, "%u_z"])
    call = f"call (%u_out_0), _optix_hitobject_traverse, ({arguments});"
    lines = lines_of(".reg.u32 %u_z, %u_out_0;", call)
    ray = ", ".join(f"v_f{k}" for k in range(2, 10))
    assert f"float ray[] = {{{ray}}}; traverse(&hit, table, v_rd1, ray, v_r1, v_r1);" in lines[0]


@pytest.mark.parametrize(
    "ptx",
    [
        "tanh.approx.f32 %f1, %f2;",
        "bar.sync 0;",
        "add.sat.f32 %f1, %f2, %f3;",
        "fma.rn.f64 %d1, %d2, %d3, %d4;",
        "cvt.rzi.u32.f64 %r1, %d2;",
        "cvt.rni.f64.f64 %d1, %d2;",
        "setp.eq.and.u32 %p1, %r2, %r3, %p4;",
        "popc.b64 %r1, %rd2;",
        "bfind.u32 %r1, %r2;",
        "atom.global.cas.b32 %r1, [%rd2], %r3, %r4;",
    ],
)
def test_unknown_instructions_are_named(ptx: str) -> None:
    with pytest.raises(UnknownPtxError, match=re.escape(ptx.split()[0])):
        lines_of(ptx)


def test_an_unknown_place_is_named() -> None:
    with pytest.raises(UnknownPtxError, match="somewhere"):
        lines_of("ld.global.b32 %r1, [somewhere];")
