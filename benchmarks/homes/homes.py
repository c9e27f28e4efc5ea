"""Example, generated and dressed homes: `make bench NAME=homes` -> out/bench/homes.json.

Plans N_PLANS generated homes; reads, repairs and samples the nine example homes bare; dresses homes that nobody tunes
on. Each home has a new process. `python -m benchmarks.homes.homes NAME` prints one home's row.
"""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final

import numpy as np
import shapely

from benchmarks.figures import write_report
from pbrs_farm.assets import furniture_package, homes_package
from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.camera import View
from pbrs_farm.core.classes import NYU13_NAMES
from pbrs_farm.core.errors import PbrsError
from pbrs_farm.core.house import House
from pbrs_farm.core.made_home import VERSION, MadeHome
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.formats.house_bundle import bundle_from_house
from pbrs_farm.generate.generated_home import drawn_home
from pbrs_farm.geometry.plan_surfaces import room_shape
from pbrs_farm.prepare.dress_catalogue import catalogue_of_words
from pbrs_farm.prepare.finished_house import finished_house
from pbrs_farm.prepare.source import resolve, variants
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.run.steps import camera_seed
from pbrs_farm.sample.house_sampler import sample_cameras
from pbrs_farm.sample.photo_choice import NYUV2_SHARES
from pbrs_farm.sample.photo_score import item_roles, photo_shares
from pbrs_farm.sample.view_overlap import DEPTH_SIZE

N_PLANS: Final = 100
N_AGAIN: Final = 5  # homes planned again by another process
DRESS_SEED: Final = 7
MADE: Final = tuple(f"made:{seed}" for seed in range(60001, 60007))
DRAWN: Final = ("Studio", "2BedroomApartment", "3BedroomHouseWithAttic", "4BedroomHouse")
_NEAR_M: Final = 1.5
_LEAST_ROOM_M2: Final = 4.0
_SIZE: Final = (160, 120)
_CONTENT: Final = {
    "views": "views of `fast` cameras",
    "objects": "items of 1 % of the picture and more, median of views",
    "classes": "NYU13 classes, median of views",
    "furniture": "share of the picture with furniture and small items, median of views",
    "openings": "share of the picture with doors and windows, median of views",
    "near": f"share of views with a median depth below {_NEAR_M} m",
    "floor": "share of views that show floor",
    "rooms_with_views": f"share of rooms above {_LEAST_ROOM_M2:g} m2 with a view",
    "share_distance": "L1 distance of NYU13 pixel shares to NYUv2's",
}
UNITS: Final = {
    "homes.plans": "generated homes planned and furnished",
    "homes.plan_failures": "of them without a home",
    "homes.plan_s": "CPU-s to plan and furnish a home, median",
    "homes.plan_s_p99": "CPU-s, 99th percentile",
    "homes.rarest_family": "share of these homes with the rarest family of plans",
    "homes.same_bits": f"1: {N_AGAIN} homes planned again by another process are equal",
    "homes.prepare_s": "CPU-s to read, repair and measure leaks, worst example home",
    "homes.leaks": "rays from closed rooms that leak, all homes",
    "homes.leak_rays": "rays from closed rooms, all homes",
    "homes.cameras_s": "s to sample all cameras of the nine example homes",
    "homes.dressed": "homes dressed",
    "homes.dress_s": "CPU-s to prepare a dressed home, worst",
    "homes.gates_broken": "items that a gate of dressing left broken",
    "homes.largest_mb": "MB of the largest house.glb",
    **{
        f"homes.{group}_{name}": f"{unit}, {group} homes"
        for group in ("bare", "drawn", "made")
        for name, unit in _CONTENT.items()
    },
}

Row = dict[str, Any]


def main() -> None:
    """Measure and write out/bench/homes.json."""
    homes_package.fetch()
    furniture_package.fetch()
    figures = plan_figures([planned(seed) for seed in range(1, N_PLANS + 1)])
    again = [_in_a_process(f"plan:{seed}")["bits"] for seed in range(1, N_AGAIN + 1)]
    figures["homes.same_bits"] = int(
        again == [planned(seed)["bits"] for seed in range(1, N_AGAIN + 1)]
    )
    bare = [_in_a_process(home.name) for home in homes_package.example_homes()]
    # Their seconds are of CPU, so two homes at a time.
    with ThreadPoolExecutor(2) as pool:
        names = [f"{name}/{DRESS_SEED}" for name in (*DRAWN, *MADE)]
        dressed = list(pool.map(_in_a_process, names))
    drawn, made = dressed[: len(DRAWN)], dressed[len(DRAWN) :]
    rows = bare + dressed
    figures |= {
        "homes.prepare_s": max(row["prepare_s"] for row in bare),
        "homes.leaks": sum(row["leaks"] for row in rows),
        "homes.leak_rays": sum(row["leak_rays"] for row in rows),
        "homes.cameras_s": round(sum(row["cameras_s"] for row in bare), 1),
        "homes.dressed": len(dressed),
        "homes.dress_s": max(row["prepare_s"] for row in dressed),
        "homes.gates_broken": sum(row["gates_broken"] for row in dressed),
        "homes.largest_mb": max(row["mb"] for row in rows),
    }
    for group, of_group in (("bare", bare), ("drawn", drawn), ("made", made)):
        figures |= {f"homes.{group}_{k}": v for k, v in content_figures(of_group).items()}
    write_report("homes", figures, UNITS)


def planned(seed: int) -> Row:
    """CPU seconds, digest and family of a generated home's plan and furniture."""
    catalogue = catalogue_of_words("")
    rng = np.random.default_rng(keys.seed("made", VERSION, MadeHome(seed).word))
    started = time.process_time()
    try:
        drawn = drawn_home(rng, catalogue)
    except (PbrsError, ArithmeticError, LookupError, ValueError, AssertionError) as error:
        print(f"made:{seed}: {type(error).__name__}: {error}")
        return {"failed": 1}
    seconds = time.process_time() - started
    bits = hashlib.sha256(repr((drawn.plan, drawn.pieces)).encode()).hexdigest()
    return {"seconds": seconds, "bits": bits, "family": drawn.plan.family}


def plan_figures(rows: Sequence[Row]) -> dict[str, Any]:
    """Failures, CPU seconds and families of planned homes."""
    good = [row for row in rows if "failed" not in row]
    seconds = [row["seconds"] for row in good]
    families = Counter(row["family"] for row in good)
    print("families", dict(families))
    return {
        "homes.plans": len(rows),
        "homes.plan_failures": len(rows) - len(good),
        "homes.plan_s": round(float(np.median(seconds)), 2),
        "homes.plan_s_p99": round(float(np.percentile(seconds, 99)), 2),
        "homes.rarest_family": round(min(families.values()) / len(good), 3),
    }


def _in_a_process(name: str) -> Row:
    command = [sys.executable, "-m", "benchmarks.homes.homes", name]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    row: Row = json.loads(done.stdout.splitlines()[-1])
    if "cameras_s" in row:
        shown = {k: v for k, v in row.items() if k != "content"}
        print(name, shown, f"{len(row['content'])} views", flush=True)
    return row


def measured(name: str) -> Row:
    """One home prepared as a run prepares it, and the contents of its views. name: HOME or HOME/DRESS_SEED."""
    home, _slash, seed = name.partition("/")
    source, recipe = resolve(home), recipe_from_name("fast")
    if seed:
        (source,) = variants(source, [int(seed)])
    started = time.process_time()
    house, repairs, dressing = finished_house(source, recipe)
    prepare_s = time.process_time() - started
    caster = Caster.of_house(house)
    began = time.perf_counter()
    sampling = sample_cameras(
        house, recipe.cameras, camera_seed(house.id, recipe), caster.item_counts, caster.item_pictures
    )  # fmt: skip
    views = list(sampling.views)
    large = {room.id for room in house.rooms if shapely.area(room_shape(room)) > _LEAST_ROOM_M2}
    return {
        "prepare_s": round(prepare_s, 1),
        "cameras_s": time.perf_counter() - began,
        "leaks": repairs.leaks.n_sky if repairs.leaks else 0,
        "leak_rays": repairs.leaks.n_rays if repairs.leaks else 0,
        "mb": round(len(bundle_from_house(house)[0]) / 1e6, 1),
        "gates_broken": sum(gate.n_left for gate in dressing.gates) if dressing else 0,
        "rooms": len(large),
        "rooms_with_views": len(large & {view.room_id for view in views}),
        "content": contents(house, caster, views),
    }


def contents(house: House, caster: Caster, views: list[View]) -> list[Row]:
    """Shares and counts of each view; nyu13: (14,) pixel shares, unlabelled first."""
    if not views:
        return []
    counts = caster.item_counts([view.camera.with_size(*_SIZE) for view in views])
    padded = np.zeros((len(views), len(house.items) + 1), np.uint32)
    padded[:, : counts.shape[1]] = counts
    depth = caster.depth_pictures([view.camera.with_size(*DEPTH_SIZE) for view in views])
    shares = photo_shares(padded, depth.reshape(len(views), -1), item_roles(house), 0.01)
    return [
        {
            "openings": float(shares.opening[k]),
            "furniture": float(shares.furniture[k]),
            "median_m": float(shares.median_m[k]),
            "floor": float(shares.floor[k]),
            "objects": int(shares.n_objects[k]),
            "nyu13": np.round(shares.nyu13[k], 5).tolist(),
        }
        for k in range(len(views))
    ]


def content_figures(rows: Sequence[Row]) -> dict[str, float]:
    """Figures of _CONTENT over all views of some homes."""
    views = [view for row in rows for view in row["content"]]
    column = {name: np.array([view[name] for view in views]) for name in views[0]}
    rooms, with_views = (sum(row[k] for row in rows) for k in ("rooms", "rooms_with_views"))
    return {
        "views": len(views),
        "objects": float(np.median(column["objects"])),
        "classes": float(np.median((column["nyu13"][:, 1:] > 0).sum(1))),
        "furniture": round(float(np.median(column["furniture"])), 3),
        "openings": round(float(np.median(column["openings"])), 3),
        "near": round(float((column["median_m"] < _NEAR_M).mean()), 3),
        "floor": round(float((column["floor"] > 0).mean()), 3),
        "rooms_with_views": round(with_views / rooms, 3),
        "share_distance": round(share_distance(column["nyu13"]), 3),
    }


def share_distance(shares: F64) -> float:
    """L1 distance of mean NYU13 shares (N, 14) to NYUv2's, without unlabelled pixels."""
    real = np.array([NYUV2_SHARES.get(name, 0.0) for name in NYU13_NAMES])
    mean = shares.mean(0)
    mean[0] = 0
    return float(np.abs(mean / mean.sum() - real / real.sum()).sum())


if __name__ == "__main__":
    if len(sys.argv) > 1:
        word, _colon, number = sys.argv[1].partition(":")
        print(json.dumps(planned(int(number)) if word == "plan" else measured(sys.argv[1])))
    else:
        main()
