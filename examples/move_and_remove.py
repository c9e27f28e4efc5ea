"""Items moved, turned and removed; the original home is unchanged."""

import sys

import pbrs_farm as pf

home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
chair = home.items.named("*chair*")[0]
moved = home.move(chair, by=(0.1, 0, 0.1), turn_deg=35)
bare = moved.without(home.items.named("lamp"))
print(home.items[chair.id].bounds.mean(0), "->", bare.items[chair.id].bounds.mean(0))
camera = home.cameras(n=1)
for name, one in {"before": home, "moved": moved, "bare": bare}.items():
    pf.render(one, camera, modes=["opengl_dl"]).save(f"out/move_and_remove/{name}")
