"""A lived-in home as one glTF scene, and as an OpenUSD stage for Isaac Sim if the extra usd is installed."""

import sys
from importlib.util import find_spec

import pbrs_farm as pf

home = pf.load(sys.argv[1] if len(sys.argv) > 1 else "Studio", recipe="preview").dress(seed=1)
scene = home.export("out/home_gltf")
again = pf.load(next(scene.glob("*.glb")), recipe="preview")
print(len(home.items), len(again.items), "things")
if find_spec("pxr"):
    print(*home.export("out/home_usd", to="usd").iterdir())
