"""Wrong calls from Python: each is one line, at the call, that names the argument."""

from __future__ import annotations

import inspect
import pickle
import warnings
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import pbrs_farm as pf
from pbrs_farm.core.camera import camera_of_recipe
from pbrs_farm.scene.home import Items, Rooms
from pbrs_farm.scene.viewpoints import Viewpoints
from pbrs_farm.views.views import Frame, Views
from tests.scene.homes import can, small_home

NAN = float("nan")
THREE: Any = 3  # a wrong type everywhere
K = [[600.0, 0, 640], [0, 600, 480], [0, 0, 1]]  # of a picture of 1280 x 960


@pytest.fixture(scope="module")
def valid_arguments(tmp_path_factory: pytest.TempPathFactory) -> SimpleNamespace:
    folder = tmp_path_factory.mktemp("wrong")
    home = small_home()
    model = can(folder)
    camera = pf.Camera.look_at((2, 1.5, 1), (2, 0.8, 3), size=(64, 48))
    views = pf.render(home.place(model, at=(2, 0.8, 3)), [camera], modes=["opengl_dl"])
    return SimpleNamespace(
        folder=folder, home=home, model=model, camera=camera, views=views, frame=views[0]
    )


Call = Callable[[Any], object]
# Function, call, expected message.
WRONG: list[tuple[str, Call, str]] = [
    ("load", lambda g: pf.load(3), "load: home: expected text or a path, got 3"),
    ("load", lambda g: pf.load(None), "load: home: .*got None"),
    ("load", lambda g: pf.load("nowhere.glb"), "nowhere.glb: .*no such file"),
    ("load", lambda g: pf.load("builtin", recipe=3), "load: recipe: expected"),
    ("load", lambda g: pf.load("builtin", "fats"), "no recipe 'fats'"),
    ("load", lambda g: pf.load("builtin", models=3), "load: models"),
    ("load", lambda g: pf.load("builtin", **{"light.spp": "many"}), "light.spp"),
    ("load", lambda g: pf.load("builtin", **{"light.sp": 3}), "light.sp"),
    ("make", lambda g: pf.make("7"), "make: seed: expected a whole number of 0 or more, got '7'"),
    ("make", lambda g: pf.make(1.5), "make: seed"),
    ("make", lambda g: pf.make(-1), "make: seed"),
    ("make", lambda g: pf.make(True), "make: seed"),
    ("make", lambda g: pf.make(7, rooms=1.5), "make: rooms"),
    ("make", lambda g: pf.make(7, rooms="many"), "rooms"),
    ("make", lambda g: pf.make(7, style="xyz"), "style"),
    ("make", lambda g: pf.make(7, rom=2), "rom"),
    ("model", lambda g: pf.model(3), "model: path"),
    ("model", lambda g: pf.model(g.folder / "none.ply"), "none.ply: no such file"),
    (
        "model",
        lambda g: pf.model(g.folder / "can.ply", size_m=0),
        "model: size_m: .* above 0, got 0",
    ),
    ("model", lambda g: pf.model(g.folder / "can.ply", size_m=-0.1), "model: size_m"),
    ("model", lambda g: pf.model(g.folder / "can.ply", size_m=NAN), "model: size_m"),
    ("model", lambda g: pf.model(g.folder / "can.ply", size_m="10 cm"), "model: size_m"),
    ("model", lambda g: pf.model(g.folder / "can.ply", unit="feet"), "unit: feet"),
    ("model", lambda g: pf.model(g.folder / "can.ply", unit=1), "model: unit"),
    ("model", lambda g: pf.model(g.folder / "can.ply", up="w"), "up: w"),
    ("model", lambda g: pf.model(g.folder / "can.ply", name=3), "model: name"),
    ("model", lambda g: pf.model(g.folder / "can.ply", category=["can"]), "model: category"),
    ("models", lambda g: pf.models(3), "models: pattern"),
    ("models", lambda g: pf.models(g.folder / "*.obj"), "no model found"),
    ("models", lambda g: pf.models(g.folder / "*.ply", size_m=-1), "model: size_m"),
    ("open", lambda g: pf.open(3), "store: cannot|open_views: place|3"),
    ("open", lambda g: pf.open(g.folder / "none"), "no such folder"),
    ("render", lambda g: pf.render("builtin", g.camera), "render: home: expected a Home.*pf.load"),
    ("render", lambda g: pf.render(g.home, "photo"), "render: cameras.*look_at"),
    ("render", lambda g: pf.render(g.home, [g.camera, THREE]), "render: cameras"),
    ("render", lambda g: pf.render(g.home, []), "cameras: give at least one"),
    ("render", lambda g: pf.render(g.home, g.camera, modes="mlt"), "modes: mlt: no such"),
    ("render", lambda g: pf.render(g.home, g.camera, modes=3), "render: modes"),
    ("render", lambda g: pf.render(g.home, g.camera, layers="albido"), "^layers: .*albedo"),
    ("render", lambda g: pf.render(g.home, g.camera, layers=[THREE]), "render: layers"),
    ("render", lambda g: pf.render(g.home, g.camera, size=640), "render: size"),
    ("render", lambda g: pf.render(g.home, g.camera, size=(0, 48)), "render: size"),
    ("render", lambda g: pf.render(g.home, g.camera, size=(64.5, 48)), "render: size"),
    ("render", lambda g: pf.render(g.home, g.camera, size=(10**6, 10**6)), "render: size.*16384"),
    ("render", lambda g: pf.render(g.home, g.camera, size=(16384, 16384)), "render: size.*mega"),
    ("render", lambda g: pf.render(g.home, g.camera, observe="print"), "render: observe"),
    (
        "render",
        lambda g: pf.render(g.home, pf.Camera(g.camera.intrinsics, np.ones((4, 4)))),
        "rigid",
    ),
    ("render_homes", lambda g: pf.render_homes("builtin", g.folder / "x"), "render_homes: homes"),
    ("render_homes", lambda g: pf.render_homes([THREE], g.folder / "x"), "render_homes: homes"),
    ("render_homes", lambda g: pf.render_homes([], g.folder / "x"), "homes: give at least one"),
    ("render_homes", lambda g: pf.render_homes(g.home, 3), "render_homes: out"),
    (
        "render_homes",
        lambda g: pf.render_homes(g.home, g.folder / "x", views=0),
        "views: .*1 or more",
    ),
    ("render_homes", lambda g: pf.render_homes(g.home, g.folder / "x", views=-3), "views"),
    ("render_homes", lambda g: pf.render_homes(g.home, g.folder / "x", views=1.5), "views"),
    ("render_homes", lambda g: pf.render_homes(g.home, g.folder / "x", jobs=0), "jobs"),
    ("render_homes", lambda g: pf.render_homes(g.home, g.folder / "x", layers=["x"]), "^layers: x"),
    ("render_homes", lambda g: pf.render_homes(g.home, g.folder / "x", modes="x"), "^modes: x"),
    ("export_views", lambda g: pf.export_views(g.folder / "none", g.folder / "y", "coco"), "none"),
    ("export_views", lambda g: pf.export_views(g.folder, g.folder / "y", "cocoa"), "^to: cocoa"),
    ("export_views", lambda g: pf.export_views(3, g.folder / "y", "coco"), "export: folder"),
    ("pack", lambda g: pf.pack("out", g.folder / "z", pf.Packing()), "pack: views"),
    ("pack", lambda g: pf.pack(g.views, g.folder / "z", "png"), "pack: packing"),
    ("pack", lambda g: pf.pack(g.views, g.folder / "z", pf.Packing(), form="x"), "^to: x|form: x"),
    ("Packing", lambda g: pf.Packing(layers=("dpeth",)), "layers: dpeth"),
    ("Packing", lambda g: pf.Packing(views_per_shard=0), "views_per_shard|views a shard"),
    ("Packing", lambda g: pf.Packing(size=640), "Packing: size"),
    ("Packing", lambda g: pf.Packing(colour="gif"), "^colour: gif"),
    ("SampleRequest", lambda g: pf.SampleRequest("dpeth"), "layers: dpeth"),
    ("SampleRequest", lambda g: pf.SampleRequest(3), "SampleRequest: layers"),
    ("SampleRequest", lambda g: pf.SampleRequest(size=64), "SampleRequest: size"),
    ("SampleRequest", lambda g: pf.SampleRequest(mode="mlt"), "mode: mlt"),
    ("Camera.look_at", lambda g: pf.Camera.look_at((1, 1), (2, 1, 1)), "look_at: eye: .*three"),
    ("Camera.look_at", lambda g: pf.Camera.look_at((1, 1, 1), (NAN, 1, 1)), "look_at: target"),
    ("Camera.look_at", lambda g: pf.Camera.look_at((1, 1, 1), (1, 1, 1)), "no direction"),
    ("Camera.look_at", lambda g: pf.Camera.look_at("eye", (1, 1, 1)), "look_at: eye"),
    ("Camera.look_at", lambda g: pf.Camera.look_at((1, 1, 1), (2, 1, 1), hfov_deg=180), "hfov_deg"),
    ("Camera.look_at", lambda g: pf.Camera.look_at((1, 1, 1), (2, 1, 1), size=(64, 0)), "size"),
    ("Camera.look_at", lambda g: pf.Camera.look_at((1, 1, 1), (2, 1, 1), K=K), "size: is missing"),
    ("Camera.look_at", lambda g: pf.Camera.look_at((1, 1, 1), (2, 1, 1), size=(10**6, 9)), "size"),
    (
        "Camera.look",
        lambda g: pf.Camera.look(g.camera.intrinsics, np.ones(3), np.zeros(3)),
        "no dir",
    ),
    ("Camera.from_opencv", lambda g: pf.Camera.from_opencv(np.ones((4, 4))), "world_from_camera"),
    ("Camera.from_opencv", lambda g: pf.Camera.from_opencv("pose"), "world_from_camera"),
    ("Camera.from_opencv", lambda g: pf.Camera.from_opencv(np.eye(4), K), "size: is missing"),
    (
        "Camera.from_opencv",
        lambda g: pf.Camera.from_opencv(np.eye(4), K, size=(640, 480)),
        "size: 640x480 is not that of K.*1280x960",
    ),
    (
        "Camera.from_opencv",
        lambda g: pf.Camera.from_opencv(np.eye(4), K, size=(960, 1280)),
        "size: 960x1280 is not that of K.*1280x960",
    ),
    ("Camera.with_size", lambda g: g.camera.with_size(0, 4), "with_size: 0x4"),
    ("Camera.pixels_of", lambda g: g.camera.pixels_of(np.zeros(3)), "points: expected .N, 3."),
    ("Camera.depths_of", lambda g: g.camera.depths_of(np.zeros((2, 2))), "points"),
    ("Home.dress", lambda g: g.home.dress(0), "dress: seed"),
    ("Home.dress", lambda g: g.home.dress("3"), "dress: seed"),
    ("Home.dress", lambda g: g.home.dress(1, clutter="much"), "dress.clutter"),
    ("Home.repair", lambda g: g.home.repair(lamp=3), "repair.lamp"),
    ("Home.export", lambda g: g.home.export(3), "export: folder"),
    ("Home.export", lambda g: g.home.export(g.folder / "e", to="obj"), "^to: obj"),
    ("Home.set", lambda g: g.home.set(spp=3), "spp"),
    ("Home.sun", lambda g: g.home.sun(azimuth="south"), "sun: azimuth"),
    ("Home.sun", lambda g: g.home.sun(elevation=NAN), "sun: elevation"),
    ("Home.sun", lambda g: g.home.sun(elevation=100), "sun_elevation_deg"),
    ("Home.sky", lambda g: g.home.sky(3), "sky: panorama"),
    ("Home.sky", lambda g: g.home.sky("none.hdr"), "no such file"),
    ("Home.place", lambda g: g.home.place("mug.glb", at=(1, 1, 1)), "place: model: .*pf.model"),
    ("Home.place", lambda g: g.home.place(g.model), "one of on=, pose= and at="),
    ("Home.place", lambda g: g.home.place(g.model, at=(1, NAN, 1)), "place: at: expected three"),
    ("Home.place", lambda g: g.home.place(g.model, at=(1, 1)), "place: at"),
    ("Home.place", lambda g: g.home.place(g.model, at=1), "place: at"),
    ("Home.place", lambda g: g.home.place(g.model, pose=np.eye(3)), "place: pose"),
    ("Home.place", lambda g: g.home.place(g.model, pose=2 * np.eye(4)), "place: pose"),
    ("Home.place", lambda g: g.home.place(g.model, pose="here"), "place: pose"),
    ("Home.place", lambda g: g.home.place(g.model, on=3), "place: on"),
    ("Home.place", lambda g: g.home.place(g.model, on="sofaa"), "sofaa: no such item"),
    ("Home.place", lambda g: g.home.place(g.model, on="sofa", seed=-1), "place: seed"),
    ("Home.scatter", lambda g: g.home.scatter(g.model, 3), "scatter: models"),
    ("Home.scatter", lambda g: g.home.scatter([], 3), "scatter: models"),
    (
        "Home.scatter",
        lambda g: g.home.scatter([g.model], 1, on="sofa", in_="Living"),
        "in_: cannot",
    ),
    (
        "Home.scatter",
        lambda g: g.home.scatter([g.model], 1, on="sofa", floating=True),
        "floating: .*support",
    ),
    ("Home.scatter", lambda g: g.home.scatter([g.model], 0), "scatter: n"),
    ("Home.scatter", lambda g: g.home.scatter([g.model], 1.5), "scatter: n"),
    ("Home.scatter", lambda g: g.home.scatter([g.model], 2, in_="Ballroom"), "Ballroom"),
    ("Home.without", lambda g: g.home.without(3), "without: items"),
    ("Home.without", lambda g: g.home.without(["sofa", 3]), "items"),
    ("Home.move", lambda g: g.home.move("sofa", by=(NAN, 0, 0)), "move: by"),
    ("Home.move", lambda g: g.home.move("sofa", by=0.1), "move: by"),
    ("Home.move", lambda g: g.home.move("sofa", turn_deg=NAN), "move: turn_deg"),
    ("Home.paint", lambda g: g.home.paint("sofa", "red"), "colour: red"),
    ("Home.paint", lambda g: g.home.paint("sofa", (1, 2, 3)), "colour"),
    ("Home.paint", lambda g: g.home.paint("sofa", 3), "paint: colour"),
    ("Home.paint", lambda g: g.home.paint("sofa", "#102030", roughness=2), "paint: roughness"),
    ("Home.material", lambda g: g.home.material("sofa", "none.png"), "none.png: no such file"),
    ("Home.material", lambda g: g.home.material("sofa", "a.png", scale_m=0), "material: scale_m"),
    ("Home.light", lambda g: g.home.light("floor lamp", lm=-1), "light: lm"),
    ("Home.light", lambda g: g.home.light("floor lamp", lm=NAN), "light: lm"),
    ("Home.light", lambda g: g.home.light("floor lamp", 9, kelvin=1), "light: kelvin"),
    ("Home.light", lambda g: g.home.light("floor lamp", 9, colour="blue"), "colour: blue"),
    ("Home.light", lambda g: g.home.light("floor lamp", 9, colour="#000000"), "colour: is black"),
    (
        "Home.light",
        lambda g: g.home.light("floor lamp", 9, 2700, "#ffffff"),
        "colour: give either this or",
    ),
    ("Home.add_light", lambda g: g.home.add_light((1, 1, NAN), 400), "add_light: at"),
    ("Home.add_light", lambda g: g.home.add_light((1, 1, 1), "bright"), "add_light: lm"),
    ("Home.add_light", lambda g: g.home.add_light((1, 1, 1), 9, towards=(1, 1, 1)), "towards"),
    ("Home.add_light", lambda g: g.home.add_light((1, 1, 1), 9, towards=(NAN, 1, 1)), "towards"),
    ("Home.add_light", lambda g: g.home.add_light((1, 1, 1), 9, angle_deg=0), "angle_deg"),
    ("Home.plan", lambda g: g.home.plan(["photo"]), "plan: cameras"),
    ("Home.sketches", lambda g: g.home.sketches([g.camera], edge_px=0), "sketches: edge_px"),
    ("Home.sketches", lambda g: g.home.sketches(g.camera), "sketches: cameras"),
    ("Home.cameras", lambda g: g.home.cameras(n="2"), "cameras: n: .*1 or more.* got '2'"),
    ("Home.cameras", lambda g: g.home.cameras(n=1.5), "cameras: n"),
    ("Home.cameras", lambda g: g.home.cameras(n=0), "cameras: n"),
    ("Home.cameras", lambda g: g.home.cameras(n=-3), "cameras: n"),
    ("Home.cameras", lambda g: g.home.cameras("photos"), "preset"),
    ("Home.cameras", lambda g: g.home.cameras(3), "cameras: preset"),
    ("Home.cameras", lambda g: g.home.cameras(hfov=1), "cameras.hfov"),
    ("Home.cameras_around", lambda g: g.home.cameras_around("sofaa"), "sofaa"),
    ("Home.cameras_around", lambda g: g.home.cameras_around(), "no model was placed"),
    ("Home.cameras_around", lambda g: g.home.cameras_around("sofa", n=0), "cameras_around: n"),
    ("Home.cameras_around", lambda g: g.home.cameras_around("sofa", distance_m=1), "distance_m"),
    (
        "Home.cameras_around",
        lambda g: g.home.cameras_around("sofa", distance_m=(-1, 1)),
        "distance_m",
    ),
    (
        "Home.cameras_around",
        lambda g: g.home.cameras_around("sofa", distance_m=(2, 1)),
        "distance_m",
    ),
    ("Home.cameras_around", lambda g: g.home.cameras_around("sofa", min_visible=2), "min_visible"),
    ("Home.cameras_around", lambda g: g.home.cameras_around("sofa", K=K), "size: is missing"),
    ("Home.viewpoint", lambda g: g.home.viewpoint("photo"), "viewpoint: camera"),
    ("Rooms.has", lambda g: g.home.rooms.has(3), "has: name"),
    ("Items.named", lambda g: g.home.items.named(3), "named: pattern"),
    ("Items.near", lambda g: g.home.items.near("sofa", within_m=-1), "near: within_m"),
    ("Items.near", lambda g: g.home.items.near("sofaa"), "sofaa"),
    ("Home.open", lambda g: g.home.open("sofa"), "has no part that opens"),
    ("Home.open", lambda g: g.home.open("sofa", 2), "open: share"),
    ("Home.open", lambda g: g.home.open("door_*", at={0: 2}), "open: at: .*seconds"),
    ("Home.open", lambda g: g.home.open("door_*", 0.9, at={0: 0, 1: 1}), "at: cannot be combined"),
    ("Home.open", lambda g: g.home.open("door_*", at={}), "open: at"),
    ("Home.drop", lambda g: g.home.drop("sofaa"), "sofaa"),
    ("Home.save", lambda g: g.home.save("home.json"), r"ends in .home.json"),
    ("Home.save", lambda g: g.home.save("/nowhere/at/all/a.home.json"), "a.home.json: "),
    ("Home.drop", lambda g: g.home.drop("sofa", push=2), "drop: push"),
    ("Home.drop", lambda g: g.home.drop("sofa", push=(1e6, 0, 0)), "drop: push: .*50 m/s"),
    ("Home.drop", lambda g: g.home.drop("sofa", spin=(0, 1e6, 0)), "drop: spin: .*rad/s"),
    ("Home.drop", lambda g: g.home.drop("wall*"), "wall_0: a wall cannot fall"),
    ("Home.drop", lambda g: g.home.drop("sofa", seconds=0), "drop: seconds"),
    ("Home.at", lambda g: g.home.at("noon"), "at: time_s"),
    ("Home.at", lambda g: g.home.at(-5), "at: time_s: .*0 or more"),
    ("Home.at", lambda g: g.home.at(float("nan")), "at: time_s"),
    ("film", lambda g: pf.film(g.home, g.camera, fps=0), "film: fps"),
    ("film", lambda g: pf.film(g.home, g.camera, seconds=1e9), "film: seconds: .*at most 100,000"),
    ("film", lambda g: pf.film(g.home, [g.camera], 2, 2), "4 frames, not 1"),
    ("film", lambda g: pf.film(g.home, g.camera, 2, 1, layers="albido"), "albedo"),
    ("Frame.layer", lambda g: g.frame.layer("depht"), "no layer depht"),
    ("Frame.layer", lambda g: g.frame.layer(3), "layer: name"),
    ("Frame.picture", lambda g: g.frame.picture("mlt_ol"), "no picture in mlt_ol"),
    ("Frame.picture", lambda g: g.frame.picture(3), "picture: mode"),
    ("Frame.classes_by", lambda g: g.frame.classes_by("none.csv"), "none.csv"),
    ("Frame.classes_by", lambda g: g.frame.classes_by(3), "classes_by: table"),
    ("Frame.mask", lambda g: g.frame.mask("mug 1"), "mug 1: is not in sight"),
    ("Frame.mask", lambda g: g.frame.mask(9999), "9999: is not in sight"),
    ("Frame.mask", lambda g: g.frame.mask(1.5), "mask: thing"),
    ("Frame.save", lambda g: g.frame.save(3), "save: place"),
    ("Frame.sample", lambda g: g.frame.sample("depth"), "sample: request"),
    ("Frame.export", lambda g: g.frame.export(g.folder / "f", to="cocoa"), "^to: cocoa"),
    ("Views.save", lambda g: g.views.save(3), "save: place"),
    ("Views.only", lambda g: g.views.only(split="trian"), "split: trian"),
    ("Views.only", lambda g: g.views.only(houses=3), "only: houses"),
    ("Views.only", lambda g: g.views.only(houses="none"), "only: houses|no view"),
    ("Views.export", lambda g: g.views.export(3), "export: out"),
    ("Views.export", lambda g: g.views.export(g.folder / "v", to="cocoa"), "^to: cocoa"),
    ("Views.export", lambda g: g.views.export(g.folder / "v", layers="dpeth"), "^layers: dpeth"),
    ("Views.export", lambda g: g.views.export(g.folder / "v", size=(0, 1)), "export: size"),
    ("load", lambda g: pf.load(""), "home: is empty"),
    ("load", lambda g: pf.load("http://example.org/home.glb"), "no such file"),
    ("make", lambda g: pf.make(10**30), "is above 2147483647"),
    ("make", lambda g: pf.make(7, rooms=1000), "1000: is above 4"),
    ("make", lambda g: pf.make(7, area=-3), "area=-3"),
    ("model", lambda g: pf.model(g.folder), "is not a supported mesh format"),
    ("model", lambda g: pf.model(g.folder / "can.ply", size_m=1e9), "1e.09 m large"),
    ("models", lambda g: pf.models([g.folder / "can.ply"]), "models: pattern"),
    ("generate_model", lambda g: pf.generate_model("bedd"), "did you mean bed"),
    ("generate_model", lambda g: pf.generate_model(3), "generate_model: name"),
    ("generate_model", lambda g: pf.generate_model("bed", width_m=1000), "bed, width_m: 1000"),
    ("generate_model", lambda g: pf.generate_model("bed", widht_m=1), "did you mean width_m"),
    ("generate_model", lambda g: pf.generate_model("bed", style="xyz"), "style: xyz: no such"),
    ("Recipe", lambda g: pf.Recipe(light=3), "^light: "),
    ("Recipe", lambda g: pf.Recipe(seed="one"), "^seed: "),
    ("Recipe", lambda g: pf.Recipe(lihgt={"spp": 3}), "lihgt.*did you mean light"),
    ("Camera", lambda g: pf.Camera(None, None), "Camera: intrinsics: .*look_at"),
    ("Camera", lambda g: pf.Camera(g.camera.intrinsics, "pose"), "Camera: world_from_camera"),
    ("Packing", lambda g: pf.Packing(layers=()), "layers: give at least one"),
    ("Packing", lambda g: pf.Packing(shares=(1, 2, 3)), "Packing: shares"),
    ("render", lambda g: pf.render([g.home], g.camera), "render: home: expected a Home"),
    ("render", lambda g: pf.render(g.home, {"eye": 1}), "render: cameras: expected"),
    (
        "render_homes",
        lambda g: pf.render_homes(g.home, g.folder / "x", pairs=3),
        "pairs: expected true or false|pairs: ",
    ),
    ("render_homes", lambda g: pf.render_homes(g.home, g.folder / "can.ply"), "is not a folder"),
    ("render_homes", lambda g: pf.render_homes(g.home, "ftp://x/y"), "not a store"),
    ("Home.dress", lambda g: g.home.dress(1, style="japandii"), "style: japandii: no such"),
    ("Home.set", lambda g: g.home.set(**{"light.spp": -1}), "light.spp: expected 1 or more"),
    ("Home.sun", lambda g: g.home.sun(), "sun: azimuth: give this, elevation"),
    ("Home.without", lambda g: g.home.without([]), "items: give at least one"),
    ("Home.move", lambda g: g.home.move([], by=(1, 0, 0)), "items: give at least one"),
    ("Home.move", lambda g: g.home.move("sofa"), "move: by: give this, turn_deg"),
    ("Home.drop", lambda g: g.home.drop([]), "items: give at least one"),
    ("Home.drop", lambda g: g.home.drop("sofa", seconds=1e9), "drop: seconds: .*600 at most"),
    ("Home.add_light", lambda g: g.home.add_light((1, 1, 1), 9, angle_deg=30), "give towards"),
    ("Home.cameras_around", lambda g: g.home.cameras_around("sofa", n=10**9), "1..10,000"),
    ("Home.open", lambda g: g.home.open("door_*", at={"a": 0}), "open: at: .*seconds"),
    ("Home.export", lambda g: g.home.export(g.folder / "e", to="coco"), "no such format of homes"),
    ("Home.export", lambda g: g.home.export(""), "already exists"),
    ("Frame.export", lambda g: g.frame.export("", to="coco"), "already exists"),
    ("Frame.layer", lambda g: g.frame.layer(""), "no layer"),
]


@pytest.mark.parametrize(
    ("name", "call", "says"), WRONG, ids=[f"{k}-{w[0]}" for k, w in enumerate(WRONG)]
)
def test_a_wrong_call_is_one_line_that_names_the_argument(
    valid_arguments: SimpleNamespace, name: str, call: Call, says: str
) -> None:
    with pytest.raises(pf.PbrsError, match=says) as caught:
        call(valid_arguments)
    assert "\n" not in str(caught.value)
    assert "--" not in str(caught.value)


def _public_calls() -> set[str]:
    """Names of all callables of the package with arguments."""
    names = {"Packing", "SampleRequest", "Recipe", "Camera"}
    for name in (
        "film",
        "generate_model",
        "load",
        "make",
        "model",
        "models",
        "open",
        "pack",
        "render",
        "render_homes",
        "export_views",
    ):
        names.add(name)
    for kind in (pf.Camera, pf.Home, Rooms, Items, Frame, Views, Viewpoints):
        for name, member in vars(kind).items():
            function = member.__func__ if isinstance(member, staticmethod) else member
            if name.startswith("_") or not inspect.isfunction(function):
                continue
            if set(inspect.signature(function).parameters) - {"self"}:
                names.add(f"{kind.__name__}.{name}")
    return names


def test_every_public_call_has_wrong_ones_in_the_table() -> None:
    assert _public_calls() == {name for name, _call, _says in WRONG}
    assert len(WRONG) >= 95


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda g: pf.render(g.home, g.camera, mode="opengl_dl"), r"render\(\): .*mode.*modes"),
        (lambda g: pf.render_homes(g.home, g.folder / "x", view=1), "'view'; did you mean views"),
        (
            lambda g: pf.render_homes(g.home, g.folder / "x", pair=True),
            "'pair'; did you mean pairs",
        ),
        (lambda g: g.home.place(g.model, in_="Bedroom"), r"place\(\): .*'in_'; of model, on"),
        (lambda g: g.home.move("sofa", to=(1, 1, 1)), r"move\(\): .*'to'"),
    ],
)
def test_an_unknown_argument_names_the_function_and_near_names(
    valid_arguments: SimpleNamespace, call: Call, says: str
) -> None:
    with pytest.raises(TypeError, match=says):
        call(valid_arguments)


WARNED: list[tuple[Call, str]] = [
    (lambda g: g.home.place(g.model, at=(-20, 0, -20)), "can 1 at .* is in no room"),
    (lambda g: g.home.place(g.model, at=(2, 30, 2)), "can 1 at .* is in no room"),
    (lambda g: g.home.move("sofa", by=(50, 0, 0)), "is in no room"),
    (lambda g: g.home.add_light((-9, 1, -9), 400), "light 1 at .* is in no room"),
]


@pytest.mark.parametrize(("call", "says"), WARNED)
def test_an_item_outside_the_home_is_a_warning_at_the_call(
    valid_arguments: SimpleNamespace, call: Call, says: str
) -> None:
    with pytest.warns(UserWarning, match=says) as heard:
        call(valid_arguments)
    assert [Path(warning.filename).name for warning in heard] == [Path(__file__).name]


def test_an_item_moved_within_its_rooms_gives_no_warning(valid_arguments: SimpleNamespace) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        moved = valid_arguments.home.move("sofa", by=(0.1, 0, 0)).place(
            valid_arguments.model, on="dining table"
        )
    assert moved.items["sofa"].room_id == valid_arguments.home.items["sofa"].room_id


def test_numbers_and_arrays_of_numpy_are_taken(valid_arguments: SimpleNamespace) -> None:
    home = valid_arguments.home.place(
        valid_arguments.model, at=np.array([2, 1, 2], np.float32), seed=np.int64(1)
    )
    assert home.items["can 1"].id == "can 1"
    assert (
        pf.Camera.look_at(np.zeros(3), np.ones(3), size=np.array([64, 48])).intrinsics.width_px
        == 64
    )
    assert len(valid_arguments.home.cameras(n=np.int64(1))) == 1


def test_cameras_have_the_size_of_the_recipe(valid_arguments: SimpleNamespace) -> None:
    home, size = valid_arguments.home, (64, 48)
    bare = pf.Camera.look_at((2, 1.5, 1), (2, 0.8, 3), hfov_deg=70)
    posed = pf.Camera.from_opencv(np.diag([1.0, -1, -1, 1]))
    for camera in (
        home.cameras(n=1)[0], home.cameras_around("sofa", min_visible=0.1)[0],
        home.viewpoint(bare), home.viewpoint(posed),
    ):  # fmt: skip
        assert (camera.camera.intrinsics.width_px, camera.camera.intrinsics.height_px) == size
    # The field of view is the requested one at any aspect.
    wide = camera_of_recipe(bare, 100, 10).intrinsics
    assert np.degrees(2 * np.arctan(50 / wide.fx)) == pytest.approx(70)
    assert wide.fx == wide.fy
    assert pf.render(home, bare, modes=[]).size == size
    assert pf.render(home, valid_arguments.camera, modes=[], size=(32, 24)).size == (32, 24)


def test_a_single_layer_or_mode_needs_no_list(valid_arguments: SimpleNamespace) -> None:
    frame = pf.render(
        valid_arguments.home, valid_arguments.camera, modes="opengl_dl", layers="albedo"
    )
    assert frame.modes == ("opengl_dl",)
    assert "albedo" in frame.layers
    assert frame.sample(pf.SampleRequest("depth", "opengl_dl")).depth is not None


def test_a_frame_pickles(valid_arguments: SimpleNamespace) -> None:
    copy = pickle.loads(pickle.dumps(valid_arguments.frame))
    assert (copy.depth == valid_arguments.frame.depth).all()
    assert len(pickle.loads(pickle.dumps(valid_arguments.views))) == 1


def test_a_mask_is_of_an_item_a_name_or_a_class(valid_arguments: SimpleNamespace) -> None:
    frame = valid_arguments.frame
    (row,) = (row for row in frame.instances if row["item"] == "can 1")
    can_1 = frame.mask("can 1")
    assert can_1.sum() == row["pixels"] > 0
    assert (can_1 == (frame.instance == row["id"])).all()
    assert (frame.mask(row["id"]) == can_1).all()
    assert (frame.mask("can") == can_1).all()
    walls = [row["id"] for row in frame.instances if row["class"] == "wall"]
    assert (frame.mask("wall") == np.isin(frame.instance, walls)).all()


def test_frames_write_themselves_in_other_forms(
    valid_arguments: SimpleNamespace, tmp_path: Path
) -> None:
    assert (
        valid_arguments.views.export(tmp_path / "coco", to="coco") / "annotations.json"
    ).is_file()
    valid_arguments.frame.save(tmp_path / "root")
    saved = pf.open(tmp_path / "root")
    assert any(saved[:1].export(tmp_path / "yolo", to="yolo").iterdir())


def test_a_light_takes_its_colour_as_rgb(valid_arguments: SimpleNamespace) -> None:
    home = valid_arguments.home.light("floor lamp", 500, colour="#ff8000")
    (light, *_) = home.items["floor lamp"].lights
    assert light.rgb_linear == pytest.approx((1, 0.2158605, 0), abs=1e-6)
    added = valid_arguments.home.add_light((2, 2, 2), 400, colour=(0.25, 0.25, 0.25))
    assert added.items["light 1"].lights[0].rgb_linear == pytest.approx((1, 1, 1))
