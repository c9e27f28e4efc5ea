"""Figures of out/bench/*.json -> rows of the tables of docs/lab/light.md; no effects.

Each function of TABLES takes the figures of its benches, name -> value, and gives lines of Markdown. A table that
lacks a figure raises KeyError with its name.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from benchmarks.light.growth import LAMPS, TRIANGLES
from benchmarks.light.measured_views import EIGHT, MeasuredView
from benchmarks.light.shots import ROOMS, SIX
from pbrs_farm.core.recipe import recipe_from_name

Figures = Mapping[str, Any]

# Key of a home's figures -> its name: those that other renderers are compared in.
RENDERED_HOMES: Final = {
    name.lower(): name for name in ("2BedroomApartment", "Studio", "3BedroomApartment")
}
CYCLES_WAYS: Final = {
    "plain": "Cycles",
    "portals": "with portals",
    "guided": "guided",
    "guided_portals": "both",
}
DENOISED_WAYS: Final = ("raw", "fast", "together", "demodulated", "prefiltered guides")
DENOISED_COUNTS: Final = (8, 16, 28, 32, 64, 128)  # samples per pixel, those of `fast` among them
PRESETS: Final = {"preview": "`preview`", "fast": "`fast`", "paper": "`paper`, reduced", "released": "`released`, reduced"}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Table:
    """A table of the docs. benches: whose JSON it reads; command: what writes them; lines: its rows."""

    benches: tuple[str, ...]
    command: str
    lines: Callable[[Figures], list[str]]


def row(cells: Iterable[str]) -> str:
    """A line of a table."""
    return f"| {' | '.join(cells)} |"


def head(*cells: str) -> list[str]:
    """The first two lines of a table."""
    return [row(cells), "|---" * len(cells) + "|"]


def view_name(view: MeasuredView) -> str:
    """A measured view, for people."""
    dressed = ", dressed" if view.dress_seed else ""
    return f"{view.home}, camera {view.camera + 1}{dressed}"


def below(figures: Figures, prefix: str) -> dict[str, Any]:
    """The figures whose names begin with prefix, by what follows it. Raises KeyError if there are none."""
    found = {k.removeprefix(prefix): v for k, v in figures.items() if k.startswith(prefix)}
    if not found:
        raise KeyError(f"{prefix}*")
    return found


def light_head() -> list[str]:
    """The head of the comparison of path and Metropolis."""
    return head(
        "", "CPU", "`path`: samples, relMSE, median pixel", "Metropolis: relMSE, median pixel",
        "relMSE, Metropolis / `path`", "median pixel, Metropolis / `path`",
    )  # fmt: skip


def light_row(name: str, f: Figures) -> str:
    """A scene's line of that table; a ratio stands with its standard error."""
    return row([
        name,
        f"{f['metropolis_s']:.1f} s",
        f"{f['path_spp']:.0f}, {f['path_relmse']:.2g}, {f['path_median']:.2g}",
        f"{f['metropolis_relmse']:.2g}, {f['metropolis_median']:.2g}",
        *(_with_spread(f, f"{r}_ratio") for r in ("relmse", "median")),
    ])  # fmt: skip


def _with_spread(f: Figures, name: str) -> str:
    return f"{f[name]:.2f} ± {f[name] * f[f'{name}_spread']:.2f}"


def light_lines(f: Figures) -> list[str]:
    """Path and Metropolis, scene by scene, and the median of the homes; then Metropolis and `fast`."""
    scenes = {name: below(f, f"light.{key}_") for key, (name, _make) in ROOMS.items()}
    scenes |= {view_name(view): below(f, f"light.{view.key}_") for view in SIX}
    homes = [_with_spread(f, f"light.homes_{part}ratio") for part in ("", "median_")]
    return [
        *light_head(),
        *(light_row(name, one) for name, one in scenes.items()),
        row(["**homes, the median of six cameras**", "", "", "", *homes]),
        "",
        *head("", "`fast`: CPU", "relMSE", "CPU of Metropolis over it, to equal relMSE"),
        *(
            row(
                [
                    name,
                    f"{one['fast_s']:.2f} s",
                    f"{one['fast_relmse']:.2g}",
                    f"{one['fast_times_cheaper']:.1f}",
                ]
            )
            for name, one in scenes.items()
        ),
        "",
        f"One mutation costs {f['light.mutation_cost']:.2g} path samples of the same depth (99 % large steps, the "
        f"bootstrap taken off); another camera compiles {f['light.compiled_by_another_camera']:.0f} kernels.",
    ]


def cycles_lines(f: Figures) -> list[str]:
    """Ours and Cycles' errors, view by view, CPU to equal error, and the medians over views."""
    rows = []
    for home in RENDERED_HOMES.values():
        for k in (0, 1):
            c = below(f, f"light.cycles_{home.lower()}_{k}_")
            theirs = [
                f"{c[f'relmse_{way}'] * c[f'cpu_s_{way}']:.2g}, {c[f'median_{way}'] * c[f'cpu_s_{way}']:.2g}"
                for way in CYCLES_WAYS
            ]
            rows.append(row([
                f"{home}, camera {k + 1}",
                f"{c['relmse'] * c['cpu_s']:.2g}, {c['median'] * c['cpu_s']:.2g}",
                *theirs,
                f"{c['ratio']:.1f}, {c['ratio_median']:.1f}",
                f"{c['ratio_metropolis']:.0f}",
                f"{c['mean_luminance_cycles'] / c['mean_luminance']:.3f}, {c['block_ratio_median']:.3f}",
            ]))  # fmt: skip
    medians = f"**{f['light.vs_cycles']:.1f}, {f['light.vs_cycles_median']:.1f}**"
    return [
        *head(
            "error x CPU: relMSE, median pixel's", "ours", *CYCLES_WAYS.values(),
            "our CPU, times less than the best of Cycles: to equal relMSE, median pixel",
            "Metropolis, to equal relMSE", "Cycles' light over ours: mean, median of 48 blocks",
        ),
        *rows,
        row(["**the median**", "", *([""] * len(CYCLES_WAYS)), medians, f"**{f['light.vs_cycles_metropolis']:.0f}**",
             f"{_luminance_apart(f):.1%} apart at most"]),
    ]  # fmt: skip


def _luminance_apart(f: Figures) -> float:
    """How far the mean luminance of Cycles' long pictures is from ours, the most of all views."""
    views = [below(f, f"light.cycles_{home}_{k}_") for home in RENDERED_HOMES for k in (0, 1)]
    return max(abs(c["mean_luminance_cycles"] / c["mean_luminance"] - 1) for c in views)


def compare_lines(f: Figures) -> list[str]:
    """The table of docs/compare.md; each row names that of the lab book which it quotes."""
    ratio_of_view = {
        f"{name}, camera {k + 1}": below(f, f"light.cycles_{home}_{k}_")["ratio"]
        for home, name in RENDERED_HOMES.items()
        for k in (0, 1)
    }
    least, most = (end(ratio_of_view, key=ratio_of_view.__getitem__) for end in (min, max))
    median, *ends = (
        f"<!-- figure: light.md#against-cycles: {words} -->"
        for words in ("**the median**", least, most)
    )
    return [
        *head("against", "measured", "ours", "theirs", "how"),
        row(["Cycles of Blender 5.0.1, the renderer below BlenderProc, Infinigen and Kubric: plain, with portals, guided, or both, whichever is best",
             "CPU to equal relative squared error, median over two views of three example homes (least, most)",
             "1", f"{f['light.vs_cycles']:.1f} ({ratio_of_view[least]:.1f}, {ratio_of_view[most]:.1f}) {median}{''.join(ends)}",
             "`make bench-cycles`, [how](lab/light.md#against-cycles)"]),
        row(["", "CPU to equal squared error of the median pixel", "1", f"{f['light.vs_cycles_median']:.1f} {median}", ""]),
        row(["", "the same, of our Metropolis to equal relative squared error", "1", f"{f['light.vs_cycles_metropolis']:.0f} {median}", ""]),
        row(["", "mean luminance of the long pictures", f"agrees to {_luminance_apart(f):.1%} {median}", "", ""]),
    ]  # fmt: skip


def view_lines(f: Figures) -> list[str]:
    """A view of `fast`, its labels, and the demo."""
    samples = recipe_from_name("fast").light.spp
    return [
        *head("two cores", "wall"),
        row([
            f"a `fast` view of Studio, 640x480, both light groups, {samples} samples, denoised, written",
            f"**{f['view.fast_s']:.1f} s**",
        ]),
        row(["the first one, which loads and compiles", f"{f['view.fast_first_s']:.1f} s"]),
        row(["all labels of a view", f"{f['view.labels_s']:.2f} s"]),
        row([
            f"`make demo` on a machine that is set up: {f['demo.views']} views",
            f"{f['demo.seconds']:.1f} s, {f['demo.peak_mb']:.0f} MB a process",
        ]),
    ]  # fmt: skip


def denoised_lines(f: Figures) -> list[str]:
    """Ways to denoise by samples."""
    rows = []
    for way in DENOISED_WAYS:
        cells = []
        for n in DENOISED_COUNTS:
            c = below(f, f"light.{way.replace(' ', '_')}_{n}_")
            cells.append(f"{c['cpu_s']:.1f} s, {c['relmse']:.2g}, {c['flip']:.3f}")
        rows.append(row([way if way != "fast" else "as `fast`", *cells]))
    return [
        *head("", *(f"{n} samples" for n in DENOISED_COUNTS)),
        *rows,
        "",
        f"`light.fast_error` is {f['light.fast_error']:.4f}; the shortest reference has "
        f"{f['light.reference_spp']} samples.",
    ]


def guided_lines(f: Figures) -> list[str]:
    """What choosing guided rays costs and brings, view by view."""
    rows = []
    for view in EIGHT:
        key = f"light.guide_{view.key}"
        rows.append(row([
            view_name(view),
            f"{f[f'{key}_trials']}",
            f"{f[f'{key}_trial_share']:.1%}",
            f"{f[key]:.3f} ± {f[f'{key}_error']:.3f}",
        ]))  # fmt: skip
    return [
        *head("", "trials of 16 that guide", "CPU of a trial", "relMSE x CPU over never guiding"),
        *rows,
        row(["**the worst**", "", "", f"{f['light.guide_worst']:.3f} ± {f['light.guide_worst_error']:.3f}"]),
    ]  # fmt: skip


def growth_lines(f: Figures) -> list[str]:
    """Cost by triangles and lamps."""
    cases = [("triangles", n, f"{n:,} triangles") for n in TRIANGLES]
    cases += [("lamps", n, f"{n} lamps in one room") for n in LAMPS]
    cases += [("lamps_of_a_home", n, f"{n} lamps, ten of them in the room") for n in LAMPS]
    rows = []
    for kind, n, name in cases:
        c = below(f, f"light.{kind}_{n}_")
        rows.append(row([
            name, f"{c['us']:.2f} us", f"{c['pilot_s']:.2f} s", f"{c['times']:.2f}",
            f"{c['small_times']:.2f}", f"{c['load_s']:.1f} s",
        ]))  # fmt: skip
    return [
        *head(
            "",
            "CPU of a sample of `fast`",
            "of its pilot and trial",
            "of a view, over the first",
            "reckoned from small pictures",
            "load",
        ),
        *rows,
        "",
        f"{f['light.growth_peak_mb'] / 1000:.1f} GB at most.",
    ]


def presets_lines(f: Figures) -> list[str]:
    """CPU and noise of the presets, home by home."""
    from benchmarks.light.presets import VIEWS

    rows = []
    for home, _camera in VIEWS:
        made = [below(f, f"presets.{home.lower()}_{preset}_") for preset in PRESETS]
        rows.append(row([home, *(f"{m['cpu_s']:.1f} s, {m['noise']:.2f}" for m in made)]))
    return [*head("CPU, noise before the denoiser", *PRESETS.values()), *rows]


def lux_lines(f: Figures) -> list[str]:
    """Illuminance of floors, home by home."""
    from pbrs_farm.assets.homes_package import example_homes

    rows = []
    for home in (h.name for h in example_homes()):
        lamps, day = (below(f, f"lux.{home.lower()}_{kind}_") for kind in ("lamps", "daylight"))
        rows.append(row([
            home, f"{lamps['rooms']}", _range(lamps), f"{lamps['below']}",
            f"{day['rooms']}", _range(day), f"{day['below']}", f"{day['above']}",
        ]))  # fmt: skip
    return [
        *head(
            "home", "rooms with lamps", "by lamps", "below 30", "rooms with windows", "by daylight",
            "below 20", "above 5,000",
        ),
        *rows,
    ]  # fmt: skip


def _range(f: Figures) -> str:
    """Least, median and most of some rooms."""
    return " / ".join(f"{f[part]:,.0f}" for part in ("least", "median", "most"))


TABLES: Final = {
    "light": Table(("light",), "make bench-light", light_lines),
    "view": Table(("view", "demo"), "python -m benchmarks view demo", view_lines),
    "denoised": Table(("denoised",), "python -m benchmarks denoised", denoised_lines),
    "guided": Table(("guided",), "python -m benchmarks guided", guided_lines),
    "growth": Table(("growth",), "python -m benchmarks growth", growth_lines),
    "presets": Table(("presets",), "python -m benchmarks presets", presets_lines),
    "lux": Table(("lux",), "python -m benchmarks lux", lux_lines),
    "cycles": Table(("cycles",), "make bench-cycles", cycles_lines),
    "compare": Table(("cycles",), "make bench-cycles", compare_lines),
}
"""Marker -> its table."""
