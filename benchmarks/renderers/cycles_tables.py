"""The two tables of the bench `cycles`: rows of docs/lab/light.md and docs/compare.md from its figures; no effects."""

from __future__ import annotations

from benchmarks.lab_rows import Figures, head, row
from benchmarks.renderers.cycles import HOMES, N_CAMERAS


def _views(figures: Figures) -> dict[str, dict[str, float]]:
    """View, for people -> its figures."""
    views = {}
    for home in HOMES:
        for k in range(N_CAMERAS):
            prefix = f"light.cycles_{home.lower()}_{k}_"
            view_figures = {
                n.removeprefix(prefix): v for n, v in figures.items() if n.startswith(prefix)
            }
            if not view_figures:
                raise KeyError(f"{prefix}*")
            views[f"{home}, camera {k + 1}"] = view_figures
    return views


def cycles_lines(f: Figures) -> list[str]:
    """Error x CPU and ratios of every view, then medians and quartiles."""
    medians = [f"**{f[f'light.vs_cycles{end}']:.1f}**" for end in ("", "_median", "_metropolis")]
    quartiles = [
        f"{f[f'light.vs_cycles{end}_q1']:.1f} to {f[f'light.vs_cycles{end}_q3']:.1f}"
        for end in ("", "_median", "_metropolis")
    ]
    return [
        *head(
            "view", "relMSE x CPU: ours, Cycles", "portals", "CPU of Cycles over ours, to equal relMSE",
            "to equal error of the median pixel", "over Metropolis, to equal relMSE", "Cycles' luminance over ours",
        ),
        *(
            row([
                name, f"{v['ours']:.2g}, {v['theirs']:.2g}", "yes" if v["portals"] else "no", f"{v['ratio']:.1f}",
                f"{v['ratio_median']:.1f}", f"{v['ratio_metropolis']:.0f}", f"{v['luminance']:.3f}",
            ])
            for name, v in _views(f).items()
        ),
        row(["**the median**", "", "", *medians, f"{f['light.cycles_luminance_apart']:.1%} apart at most"]),
        row(["quartiles", "", "", *quartiles, ""]),
    ]  # fmt: skip


def compare_lines(f: Figures) -> list[str]:
    """The table of docs/compare.md; each row names the row of the lab book that it quotes."""
    median, quartiles = (
        f"<!-- figure: light.md#against-cycles: {words} -->"
        for words in ("**the median**", "quartiles")
    )
    q1, q3 = f["light.vs_cycles_q1"], f["light.vs_cycles_q3"]
    return [
        *head("against", "measured", "ours", "theirs", "how"),
        row([
            "Cycles of Blender 5.0.1, the renderer of BlenderProc, Infinigen and Kubric: plain or with portals, whichever is cheaper",
            f"CPU to equal relative squared error, median of {len(HOMES) * N_CAMERAS} views of {len(HOMES)} example homes (quartiles)",
            "1", f"{f['light.vs_cycles']:.1f} ({q1:.1f} to {q3:.1f}) {median}{quartiles}",
            "`make bench-cycles`, [how](lab/light.md#against-cycles)",
        ]),
        row(["", "CPU to equal squared error of the median pixel", "1", f"{f['light.vs_cycles_median']:.1f} {median}", ""]),
        row(["", "the same, of our Metropolis to equal relative squared error", "1", f"{f['light.vs_cycles_metropolis']:.0f} {median}", ""]),
        row(["", "mean luminance of the long pictures", f"agrees to {f['light.cycles_luminance_apart']:.1%} {median}", "", ""]),
    ]  # fmt: skip
