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

LUXCORE_SCENES: Final = {
    **{key: name for key, (name, _make) in ROOMS.items()},
    "home": "2BedroomApartment, camera 1",
}
LUXCORE_ENGINES: Final = ("lux_path", "lux_path_metropolis", "lux_bidir", "lux_bidir_metropolis")
_LUXCORE_HEADS: Final = ("LuxCore path", "path, Metropolis", "bidirectional", "bidirectional, Metropolis")  # fmt: skip
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


# Path and Metropolis at equal CPU.


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


# Against other renderers.


def luxcore_costs_head() -> list[str]:
    """The head of the comparison with LuxCore: relMSE and the median pixel's error."""
    return head(
        "", "CPU", "our `path`", "our Metropolis", *_LUXCORE_HEADS,
        "our Metropolis / LuxCore's bidirectional Metropolis", "our `path` / LuxCore's",
    )  # fmt: skip


def luxcore_costs_row(name: str, f: Figures) -> str:
    """A scene's line of it."""
    engines = ("path", "metropolis", *LUXCORE_ENGINES)
    errors = [f"{f[f'{e}_relmse']:.2g}, {f[f'{e}_median']:.2g}" for e in engines]
    ratios = [f"{f[f'{p}relmse_ratio']:.2g}, {f[f'{p}median_ratio']:.2g}" for p in ("", "path_")]
    return row([name, f"{f['cpu_s']:.1f} s", *errors, *ratios])


def luxcore_lights_head() -> list[str]:
    """The head of the light of LuxCore over ours: mean and median of blocks."""
    return head("", "our Metropolis", *_LUXCORE_HEADS)


def luxcore_lights_row(name: str, f: Figures) -> str:
    """A scene's line of it."""
    engines = ("metropolis", *LUXCORE_ENGINES)
    cells = [f"{f[f'{e}_mean_over_path']:.3f}, {f[f'{e}_blocks_over_path']:.3f}" for e in engines]
    return row([name, *cells])


def luxcore_lines(f: Figures) -> list[str]:
    """Errors at equal CPU, a column a scene."""
    scenes = LUXCORE_SCENES.items()
    rows = [luxcore_costs_row(name, below(f, f"light.luxcore_{key}_")) for key, name in scenes]
    return _turned([*luxcore_costs_head(), *rows])


def _turned(lines: list[str]) -> list[str]:
    """A table with its rows for columns: one of many columns does not fit the page."""
    cells = [[c.strip() for c in line.strip("|").split("|")] for line in (lines[0], *lines[2:])]
    names, *rows = zip(*cells, strict=True)
    return [*head(*names), *(row(list(r)) for r in rows)]


def luxcore_lights_lines(f: Figures) -> list[str]:
    """Mean pictures over those of our path, scene by scene."""
    scenes = LUXCORE_SCENES.items()
    rows = [luxcore_lights_row(name, below(f, f"light.luxcore_{key}_")) for key, name in scenes]
    return [*luxcore_lights_head(), *rows]


def cycles_lines(f: Figures) -> list[str]:
    """Ours and Cycles' errors of 32 samples, and CPU to equal error."""
    columns = []
    for k in (1, 2):
        c = below(f, f"light.cycles_{k}_")
        columns.append([
            f"{c['relmse']:.2g} / {c['relmse_cycles']:.2g}",
            f"{c['median'] ** 0.5:.2g} / {c['median_cycles'] ** 0.5:.2g}",
            f"{c['cpu_s']:.2f} / {c['cpu_s_cycles']:.2f} s",
            f"{c['setup_s']:.1f} / {c['setup_s_cycles']:.1f} s",
            f"**{c['ratio']:.0f} times less**",
            f"{c['ratio_median']:.1f} times less",
            f"{c['ratio_metropolis']:.0f} times less",
            f"{c['mean_luminance_cycles'] / c['mean_luminance']:.3f}, {c['block_ratio_median']:.3f}",
        ])  # fmt: skip
    names = (
        "relMSE, ours / Cycles", "median pixel", "CPU of the samples", "CPU of a picture of one sample",
        "our CPU to equal relMSE", "to equal median pixel", "of Metropolis, to equal relMSE",
        "Cycles' light over ours, long pictures: mean, median of 48 blocks",
    )  # fmt: skip
    return [
        *head("2BedroomApartment", "first camera", "second camera"),
        *(row([name, *cells]) for name, *cells in zip(names, *columns, strict=True)),
    ]


def compare_lines(f: Figures) -> list[str]:
    """The table of docs/compare.md."""
    one, two = (below(f, f"light.cycles_{k}_") for k in (1, 2))
    ratios = {
        end: [f[f"light.luxcore_{key}_{end}"] for key in LUXCORE_SCENES]
        for end in ("path_relmse_ratio", "relmse_ratio")
    }
    shift = max(abs(c["mean_luminance_cycles"] / c["mean_luminance"] - 1) for c in (one, two))
    paths, chains = (f"{min(v):.2g} to {max(v):.2g}" for v in ratios.values())
    return [
        *head("against", "measured", "ours", "theirs", "how"),
        row(["Cycles of Blender 5.0.1, the renderer below BlenderProc, Infinigen and Kubric",
             "relative squared error at 32 samples, first and second camera of an example home",
             f"{one['relmse']:.2g}, {two['relmse']:.2g}",
             f"{one['relmse_cycles']:.2g}, {two['relmse_cycles']:.2g}",
             "`make bench-cycles`, [how](lab/light.md#against-cycles)"]),
        row(["", "CPU seconds of those 32 samples", f"{one['cpu_s']:.2f}, {two['cpu_s']:.2f}",
             f"{one['cpu_s_cycles']:.2f}, {two['cpu_s_cycles']:.2f}", ""]),
        row(["", "CPU to equal squared error", "1", f"{one['ratio']:.0f}, {two['ratio']:.0f}", ""]),
        row(["", "mean luminance of the long pictures", f"agrees to {shift:.1%}", "", ""]),
        row(["LuxCore 2.11.2, path, equal CPU",
             "relative squared error, ratio over five scenes (below 1 favours ours)", paths, "1",
             "`make bench-luxcore`, [how](lab/light.md#against-luxcore)"]),
        row(["LuxCore 2.11.2, bidirectional Metropolis, equal CPU", "the same, against our Metropolis",
             chains, "1", ""]),
    ]  # fmt: skip


# What a view costs.


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
    "luxcore": Table(("luxcore",), "make bench-luxcore", luxcore_lines),
    "luxcore_light": Table(("luxcore",), "make bench-luxcore", luxcore_lights_lines),
    "compare": Table(("cycles", "luxcore"), "make bench-cycles bench-luxcore", compare_lines),
}
"""Marker -> its table."""
