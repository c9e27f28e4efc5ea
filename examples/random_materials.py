"""Every piece of furniture in a colour by seed: domain randomisation."""

import sys

import numpy as np

import pbrs_farm as pf

home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
camera = home.cameras(n=1)
for seed in range(3):
    rng, one = np.random.default_rng(seed), home
    for item in home.items.named("object")[:12]:
        one = one.paint(item, rng.random(3), roughness=rng.uniform(0.1, 0.9))
    pf.render(one, camera, modes=["opengl_dl"]).save(f"out/random_materials/{seed}")
