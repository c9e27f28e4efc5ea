"""Mirror images and gloss, recomputed by `verify` in a home whose walls are mirrors."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.check import verify
from pbrs_farm.core.house import House, Material, MaterialKind
from pbrs_farm.images import array_from_png
from pbrs_farm.read.builtin.builtin_home import builtin_home
from tests.check.roots import changed_pixel, failed, house_of, make_root, sign

GLOSSY = (
    Material("steel", specular=(0.9, 0.8, 0.7), diffuse=(0.1, 0.1, 0.1), roughness=0.3),
    Material("varnish", specular=(0.6, 0.6, 0.6), shininess=60.0),
    Material("lacquer", roughness=0.1),
)


def mirrored_home() -> House:
    """The small home with mirrors as most wall covers and different gloss on everything else."""
    home = builtin_home()
    walls = {s.material for i in home.items if i.kind.value == "wall" for s in i.surfaces}
    materials = []
    for k, material in enumerate(home.materials):
        glossy = GLOSSY[k % len(GLOSSY)]
        if k in walls:
            materials.append(replace(material, kind=MaterialKind.MIRROR))
        elif material.kind is MaterialKind.OPAQUE:
            materials.append(replace(glossy, name=material.name, texture_id=material.texture_id))
        else:
            materials.append(material)
    return replace(home, materials=tuple(materials))


@pytest.fixture(scope="module")
def mirrored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("mirrored")
    make_root(root, mirrored_home(), with_optional=True)
    return root


def test_mirror_images_are_recomputed_to_the_last_pixel(mirrored):
    views = house_of(mirrored) / "views"
    pictures = {
        name: np.stack([array_from_png((v / f"{name}.png").read_bytes()) for v in views.iterdir()])
        for name in ("mirror", "instance", "behind_mirror/instance", "roughness")
    }
    is_mirror = pictures["mirror"] > 0
    differs = pictures["behind_mirror/instance"] != pictures["instance"]
    assert is_mirror.mean() > 0.2
    assert differs[is_mirror].mean() > 0.5
    assert not differs[~is_mirror].any()
    assert len(np.unique(pictures["roughness"])) >= 4
    certificate = verify(mirrored, all_pixels=True)
    assert certificate.is_clean, certificate.text()


@pytest.mark.quick(1)
@pytest.mark.parametrize("name", ["depth", "normal", "semantic", "instance"])
def test_a_changed_pixel_behind_a_mirror_is_caught(mirrored, tmp_path, name):
    shutil.copytree(mirrored, tmp_path / "root")
    house = house_of(tmp_path / "root")
    mirror = array_from_png((house / "views/v0/mirror.png").read_bytes())
    row, column = np.argwhere(mirror > 0)[len(np.argwhere(mirror > 0)) // 2]
    file = house / f"views/v0/behind_mirror/{name}.png"
    changed_pixel(file, row, column, 900 if name == "normal" else 2)
    sign(tmp_path / "root", house)
    assert f"ray: behind mirror {name}" in failed(tmp_path / "root")
