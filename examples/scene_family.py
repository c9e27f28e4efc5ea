"""A data set from a function of a seed: every home is sent to this machine's processes."""

import sys

import trimesh

import pbrs_farm as pf


def shelf(seed: int) -> pf.Home:
    """The scene of a seed."""
    home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
    return home.scatter([pf.model("ball.glb", category="ball")], n=5, seed=seed)


if __name__ == "__main__":
    trimesh.creation.icosphere(radius=0.04).export("ball.glb")
    frames = pf.render_homes(
        [shelf(s) for s in range(2)], "out/family", views=1, modes=["opengl_dl"]
    )
    print(frames)
