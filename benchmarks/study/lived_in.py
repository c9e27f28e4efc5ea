"""Do lived-in homes teach more than bare ones? Renders, trains, judges: hours on two cores.

Five sets of views, equally many, three seeds each, plan tiny for normals; judged on held-out homes
bare and dressed and, where named, on photographs with depth. Effects: out/study; a run that is cut
off goes on. `python -m benchmarks.study.lived_in [PHOTOGRAPHS...]`.
"""

from __future__ import annotations

import sys

import pbrs_farm.cli
from benchmarks.study.rendered import FOLDER, HELD_OUT, HOMES, rendered

MADE = "made:1..12"
VIEWS = 250  # of each set
RUNS = FOLDER / "lived_in"


def main() -> None:
    """Print the table and leave it in out/study/lived_in/table.md."""
    photographs = [word for word in sys.argv[1:] if word != "lived_in"]
    modes = ("--modes", "mlt_il_ol", "opengl_dl", "mlt_ol", "opengl_il")
    views = ("--views", "45")
    fast = rendered("bare_fast", HOMES, "--set", "cameras.preset=paper", *views, *modes)
    photo = rendered("bare_photo", HOMES, *views, *modes)
    dressed = rendered("dressed", HOMES, "--dress", "1", *views, *modes)
    made = rendered("made", (MADE,), "--dress", "1", "--views", "20", *modes)
    rows = [
        f"bare_fast={fast}@mlt_il_ol", f"bare_photo={photo}@mlt_il_ol",
        f"dressed={dressed}@mlt_il_ol", f"dressed_opengl_dl={dressed}@opengl_dl",
        f"made_and_dressed={dressed}+{made}@mlt_il_ol",
    ]  # fmt: skip
    words = ["ablation", *rows, "--task", "normals", "--seeds", "3", "--views", str(VIEWS)]
    for on in (f"bare={photo}", f"dressed={dressed}", *photographs):
        words += ["--on", on]
    pbrs_farm.cli.main([*words, "--hold-out", *HELD_OUT, "--out", str(RUNS)])


if __name__ == "__main__":
    main()
