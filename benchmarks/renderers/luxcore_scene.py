"""Renders exported scenes with LuxCore: run by benchmarks/renderers/luxcore.py, in its own Python.

`pyluxcore` is Apache-2.0. This file imports nothing of pbrs_farm and nothing imports it; both sides
meet in files: scene.npz, scene.json, dome.npy, linear textures as NPY. For every job of jobs.json it
renders a picture ((H, W, 3) float32 radiance, NPY) until its threads have had the asked processor
time, and prints one line of JSON with what they had. "more" of a job: LuxCore's own settings.

A lamp's triangle shines from its front alone. A thin pane as ours is not among LuxCore's materials
(ArchGlass reflects from its front alone): here it is a mirror by PANE_REFLECTANCE, whatever the
angle, and for the rest nothing, which shadow rays pass.
"""

from __future__ import annotations

import json
import math
import os
import sys
import time
from pathlib import Path

import numpy as np
import pyluxcore  # type: ignore[import-not-found]

SURFACE, MIRROR, GLASS, NULL = 0, 1, 2, 3

PANE_REFLECTANCE = 2 * 0.04 / 1.04
"""What a thin pane of index 1.5 reflects at right angles."""

ZUP_FROM_WORLD = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], np.float64)
"""The exported world has +y up, LuxCore's sky +z."""

SUN_SINE = 695_500 / 149_600_000
"""Of the half angle of LuxCore's sun of relative size 1."""

POLL_S = 0.005


def main(folder: Path) -> None:
    """Do the jobs of folder; each names the scene, a folder below."""
    pyluxcore.Init(lambda _message: None)
    loaded = None, None
    for job in json.loads((folder / "jobs.json").read_text()):
        if loaded[0] != job["scene"]:
            loaded = job["scene"], load(folder / job["scene"])
        print(json.dumps(render(loaded[1], job, folder)), flush=True)
    # The interpreter's end and LuxCore's threads do not go together.
    sys.stdout.flush()
    os._exit(0)


def load(folder: Path):  # type: ignore[no-untyped-def]
    """The scene of an exported folder."""
    described = json.loads((folder / "scene.json").read_text())
    arrays = np.load(folder / "scene.npz")
    scene = pyluxcore.Scene()
    props = pyluxcore.Properties()
    for k, part in enumerate(described["parts"]):
        if part["texture"]:
            add_texture(scene, folder, part["texture"])
        set_all(props, material(f"m{k}", part))
    scene.Parse(props)
    props = pyluxcore.Properties()
    for k, part in enumerate(described["parts"]):
        add_mesh(
            scene, f"s{k}", arrays, arrays["face_part"] == k, is_lamp=max(part["radiance"]) > 0
        )
        set_all(
            props, {f"scene.objects.o{k}.shape": f"s{k}", f"scene.objects.o{k}.material": f"m{k}"}
        )
    scene.Parse(props)
    props = pyluxcore.Properties()
    set_all(props, lights(scene, folder, described["sun"]))
    scene.Parse(props)
    return scene


def set_all(props, values) -> None:  # type: ignore[no-untyped-def]
    """Set properties from a dictionary; lists become a property of many values."""
    for name, value in values.items():
        props.Set(pyluxcore.Property(name, value))


def add_mesh(scene, name, arrays, mine, *, is_lamp) -> None:  # type: ignore[no-untyped-def]
    """A mesh of the faces `mine`, three vertices of its own each; lamps shine flat."""
    n = 3 * int(mine.sum())
    corners = arrays["positions"][arrays["faces"][mine]].reshape(n, 3) @ ZUP_FROM_WORLD.T
    normals = arrays["normals"][mine].reshape(n, 3) @ ZUP_FROM_WORLD.T
    scene.DefineMeshExt(
        name,
        np.ascontiguousarray(corners, np.float32),
        np.arange(n, dtype=np.uint32).reshape(-1, 3),
        None if is_lamp else np.ascontiguousarray(normals, np.float32),
        [np.ascontiguousarray(arrays["uvs"][mine].reshape(n, 2), np.float32)],
        None,
        None,
        None,
    )


def add_texture(scene, folder, name) -> None:  # type: ignore[no-untyped-def]
    """An image map of linear values, once."""
    if scene.IsImageMapDefined(name):
        return
    picture = np.load(folder / f"{name}.npy")
    height, width, channels = picture.shape
    scene.DefineImageMap(name, np.ascontiguousarray(picture), 1.0, channels, width, height)


def material(name, part):  # type: ignore[no-untyped-def]
    """Properties of one exported material row."""
    here = f"scene.materials.{name}"
    if part["cutout"]:
        raise ValueError(f"{part['name']}: cut-outs are not translated")
    out = {}

    def colour(key, rgb):  # type: ignore[no-untyped-def]
        """A colour, times the texture where there is one."""
        if not part["texture"]:
            return list(rgb)
        picture, product = f"scene.textures.{name}{key}p", f"scene.textures.{name}{key}"
        out[f"{picture}.type"], out[f"{picture}.file"] = "imagemap", part["texture"]
        out[f"{picture}.gamma"] = 1.0
        # Row 0 of a picture is v = 1 to us and v = 0 to LuxCore.
        out[f"{picture}.mapping.type"] = "uvmapping2d"
        out[f"{picture}.mapping.uvscale"], out[f"{picture}.mapping.uvdelta"] = [1, -1], [0, 1]
        out[f"{product}.type"], out[f"{product}.texture1"] = "scale", f"{name}{key}p"
        out[f"{product}.texture2"] = list(rgb)
        # What a surface reflects is held to part["max_kd"], as by our kernels.
        held = f"scene.textures.{name}{key}h"
        out[f"{held}.type"], out[f"{held}.texture"] = "clamp", f"{name}{key}"
        out[f"{held}.min"], out[f"{held}.max"] = 0.0, part["max_kd"] if key == "d" else 1.0
        return f"{name}{key}h"

    if part["kind"] == MIRROR:
        out |= {f"{here}.type": "mirror", f"{here}.kr": part["f0"]}
    elif part["kind"] == GLASS:
        clear, shine = f"{name}clear", f"{name}shine"
        out |= {
            f"scene.materials.{clear}.type": "null",
            f"scene.materials.{clear}.transparency": colour("t", part["tau"]),
            f"scene.materials.{shine}.type": "mirror",
            f"scene.materials.{shine}.kr": [1.0, 1.0, 1.0],
            f"{here}.type": "mix",
            f"{here}.material1": clear,
            f"{here}.material2": shine,
            f"{here}.amount": PANE_REFLECTANCE,
        }
    elif part["kind"] == NULL:
        out[f"{here}.type"] = "null"
    elif max(part["tau"]) > 0:
        if part["texture"]:
            raise ValueError(f"{part['name']}: textured sheets are not translated")
        # LuxCore lets through kt of what is not reflected.
        through = [t / (1 - r) for t, r in zip(part["tau"], part["kd"], strict=True)]
        out |= {f"{here}.type": "mattetranslucent", f"{here}.kr": part["kd"], f"{here}.kt": through}
    else:
        out |= {f"{here}.type": "matte", f"{here}.kd": colour("d", part["kd"])}
    if max(part["radiance"]) > 0:
        # Unasked, a mesh of more than 24 triangles is not sampled as a lamp.
        out |= {
            f"{here}.emission": part["radiance"],
            f"{here}.emission.directlightsampling.type": "ENABLED",
        }
    return out


def lights(scene, folder, sun):  # type: ignore[no-untyped-def]
    """Properties of the dome and of the sun's disc."""
    out = {}
    dome = np.load(folder / "dome.npy")
    height, width = dome.shape[:2]
    if dome.max() > 0:
        # LuxCore's azimuth runs the other way round and starts a quarter turn off ours.
        turned = np.roll(dome[:, ::-1], width // 4, axis=1)
        scene.DefineImageMap(
            "dome", np.ascontiguousarray(turned, np.float32), 1.0, 3, width, height
        )
        out |= {
            "scene.lights.dome.type": "infinite",
            "scene.lights.dome.file": "dome",
            "scene.lights.dome.gamma": 1.0,
        }
    if max(sun["irradiance"]) > 0:
        gain = np.array(sun["irradiance"]) / irradiance_of_sun(sun)
        out |= sun_disc(sun, gain.tolist())
    return out


def sun_disc(sun, gain):  # type: ignore[no-untyped-def]
    """Properties of LuxCore's `sun`: `distant` is its other disc, to which BIDIRCPU is blind."""
    return {
        "scene.lights.sun.type": "sun",
        "scene.lights.sun.dir": (ZUP_FROM_WORLD @ np.array(sun["direction"])).tolist(),
        "scene.lights.sun.relsize": math.sin(sun["half_angle_rad"]) / SUN_SINE,
        "scene.lights.sun.gain": gain,
    }


def irradiance_of_sun(sun):  # type: ignore[no-untyped-def]
    """(3,) irradiance that `sun` gives at gain 1, on a matte plate that faces it: measured."""
    towards = np.array(sun["direction"])
    side = np.cross(towards, [0.3, 0.5, -0.8])
    side /= np.linalg.norm(side)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([side, np.cross(towards, side), towards], 1)
    pose[:3, 3] = towards
    corners = np.array([[-9, -9, -1], [9, -9, -1], [0, 9, -1]]) @ pose[:3, :3].T + towards
    scene, props = pyluxcore.Scene(), pyluxcore.Properties()
    plate = {
        "positions": corners,
        "faces": np.array([[0, 1, 2]]),
        "normals": np.tile(towards, (1, 3, 1)),
        "uvs": np.zeros((1, 3, 2)),
    }
    add_mesh(scene, "plate", plate, np.ones(1, bool), is_lamp=False)
    set_all(
        props,
        {
            "scene.materials.grey.type": "matte",
            "scene.materials.grey.kd": [0.5, 0.5, 0.5],
            "scene.objects.plate.shape": "plate",
            "scene.objects.plate.material": "grey",
            **sun_disc(sun, [1.0, 1.0, 1.0]),
        },
    )
    scene.Parse(props)
    job = {
        "camera": {"hfov_rad": 0.3, "world_from_camera": pose},
        "size": [8, 8],
        "engine": "PATHCPU",
        "sampler": "SOBOL",
        "seed": 1,
        "max_depth": 2,
        "roulette": False,
        "cpu_s": 0.1,
    }
    return rendered(scene, job)[0].mean((0, 1)) * math.pi / 0.5


def render(scene, job, folder):  # type: ignore[no-untyped-def]
    """Render a picture into job["file"]; what it cost."""
    picture, cost = rendered(scene, job)
    np.save(folder / job["file"], picture)
    return {"file": job["file"], "luxcore": pyluxcore.Version(), **cost}


def rendered(scene, job):  # type: ignore[no-untyped-def]
    """((H, W, 3) float32, its cost) of a job."""
    scene.Parse(camera(job))
    config = pyluxcore.RenderConfig(settings(job), scene)
    began = time.process_time()
    session = pyluxcore.RenderSession(config)
    session.Start()
    ready = time.process_time()
    while time.process_time() - ready < job["cpu_s"]:
        time.sleep(POLL_S)
    session.Stop()
    cost = {"cpu_s": time.process_time() - ready, "setup_s": ready - began}
    width, height = job["size"]
    picture = np.zeros(width * height * 3, np.float32)
    session.GetFilm().GetOutputFloat(pyluxcore.FilmOutputType.RGB, picture, 0, False)
    # LuxCore's first row is the lowest.
    return picture.reshape(height, width, 3)[::-1], cost


def camera(job):  # type: ignore[no-untyped-def]
    """Properties of a pinhole camera of the exported pose: OpenGL axes."""
    pose = np.array(job["camera"]["world_from_camera"])
    eye = ZUP_FROM_WORLD @ pose[:3, 3]
    towards, up = -ZUP_FROM_WORLD @ pose[:3, 2], ZUP_FROM_WORLD @ pose[:3, 1]
    width, height = job["size"]
    # LuxCore draws the row above: the window is moved by a pixel.
    tall, row = height / width, 2 / width
    props = pyluxcore.Properties()
    set_all(
        props,
        {
            "scene.camera.screenwindow": [-1.0, 1.0, -tall - row, tall - row],
            "scene.camera.type": "perspective",
            "scene.camera.lookat.orig": eye.tolist(),
            "scene.camera.lookat.target": (eye + towards).tolist(),
            "scene.camera.up": up.tolist(),
            "scene.camera.fieldofview": math.degrees(job["camera"]["hfov_rad"]),
            "scene.camera.lensradius": 0.0,
            "scene.camera.autofocus.enable": False,
            "scene.camera.cliphither": 1e-3,
            "scene.camera.clipyon": 1e4,
        },
    )
    return props


def settings(job):  # type: ignore[no-untyped-def]
    """LuxCore as it comes, but for what would bias it or clean it.

    No filter, no adaption, no clamping (off unless asked); Russian roulette only where asked: its
    weights of the balance heuristic take another chance to survive than its paths have.
    """
    width, height = job["size"]
    # PATHCPU counts segments, BIDIRCPU the vertices of either end; one more segment joins them.
    segments, vertices = job["max_depth"], job["max_depth"] - 1
    values = {
        "renderengine.type": job["engine"],
        "renderengine.seed": job["seed"],
        "sampler.type": job["sampler"],
        "sampler.sobol.adaptive.strength": 0.0,
        "film.width": width,
        "film.height": height,
        "film.filter.type": "NONE",
        "film.imagepipelines.0.0.type": "NOP",
        "film.outputs.0.type": "RGB",
        "film.outputs.0.filename": "unused.exr",
        "path.pathdepth.total": segments,
        "path.pathdepth.diffuse": segments,
        "path.pathdepth.glossy": segments,
        "path.pathdepth.specular": segments,
        "path.maxdepth": vertices,
        "light.maxdepth": vertices,
        "path.clamping.variance.maxvalue": 0.0,
    }
    if not job["roulette"]:
        values["path.russianroulette.depth"] = 2 * segments
    props = pyluxcore.Properties()
    set_all(props, values | job.get("more", {}))
    return props


if __name__ == "__main__":
    main(Path(sys.argv[1]))
