"""The pictures of docs/howto, drawn from the files that the pages' commands write to out/.

    python scripts/howto_pictures.py [PAGE ...]

Run a page's commands first (a view or two at 320x240 is enough); a page with missing files is named and
skipped. Some need more than their page: photos/*.png are your photographs (predict, train's views
under viewseen/, photographs, photographs_seen), farm.png and job.png are screenshots of the board, spp4 to spp256 are runs of
the last line of light_costs.md, back is simulators.md's export rendered again, ownviews a run with own_furniture.md's
catalogue, light/NN_NAME.png the pictures of relight.md's table, resume_sums.npz the sums that a killed view leaves
beside its outputs. A name in PAGES is that of a picture, which a page shows.
Effects: reads out/, writes docs/pictures/howto/NAME.jpg, 640 pixels wide (screenshots at full width) and
at most 60 kB, and the pictures of relight.md, compare.md and train.md beside them.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

import pbrs_farm as pf
from pbrs_farm.core.errors import PbrsError
from pbrs_farm.core.recipe import recipe_from_json
from pbrs_farm.gallery import label_colours
from pbrs_farm.images import array_from_png
from pbrs_farm.transport.develop.mode_pictures import LinearAovs, develop

OUT, PICTURES = Path("out"), Path("docs/pictures/howto")
WIDTH_PX, MAX_BYTES, GAP_PX = 640, 60_000, 4
PALETTE: Final = np.array(
    [[230, 75, 60], [70, 140, 220], [250, 190, 50], [90, 180, 100], [160, 100, 200], [240, 130, 180],
     [60, 190, 190], [150, 110, 70]], np.uint8,
)  # fmt: skip

Pixels = NDArray[np.uint8]


def row(*panels: Any) -> Image.Image:
    """Panels side by side at the first one's height, together WIDTH_PX wide."""
    images = [p if isinstance(p, Image.Image) else Image.fromarray(np.asarray(p)) for p in panels]
    shares = [i.width / i.height for i in images]
    height = round((WIDTH_PX - GAP_PX * (len(images) - 1)) / sum(shares))
    sheet, x = Image.new("RGB", (WIDTH_PX, height), "white"), 0
    for n, (image, share) in enumerate(zip(images, shares, strict=True)):
        last = n == len(images) - 1
        width = WIDTH_PX - x if last else round(height * share)
        kind = Image.Resampling.LANCZOS if image.width >= width else Image.Resampling.BICUBIC
        sheet.paste(image.convert("RGB").resize((width, height), kind), (x, 0))
        x += width + GAP_PX
    return sheet


def rows(*sheets: Image.Image) -> Image.Image:
    """Rows under each other."""
    height = sum(s.height for s in sheets) + GAP_PX * (len(sheets) - 1)
    whole, y = Image.new("RGB", (WIDTH_PX, height), "white"), 0
    for sheet in sheets:
        whole.paste(sheet, (0, y))
        y += sheet.height + GAP_PX
    return whole


def first(pattern: str, skip: int = 0) -> Path:
    """The first match of a pattern in out/ after skip others."""
    matches = sorted(OUT.glob(pattern))
    if len(matches) <= skip:
        raise FileNotFoundError(f"out/{pattern}")
    return matches[skip]


def blended(picture: Pixels, colours: Pixels, where: NDArray[np.bool_]) -> Pixels:
    """A picture blended with half transparent colours."""
    mixed = (0.45 * picture + 0.55 * colours).astype(np.uint8)
    return np.where(where[..., None], mixed, picture // 2 + 90)


def own_camera() -> Image.Image:
    return row(pf.open("out/own_camera/one")[0].colour)


def sun_and_hour() -> Image.Image:
    return row(*(pf.open(f"out/sun/day/{hour}")[0].colour for hour in (7, 12, 18)))


def night() -> Image.Image:
    frames = pf.open("out/sun/night")
    return row(frames[0].colour, frames[1].colour)


def intrinsic() -> Image.Image:
    frame = pf.open("out/intrinsic/views")[0]

    def shown(light: NDArray[Any], white: float) -> Pixels:
        return (255 * np.clip(light / white, 0, 1) ** (1 / 2.2)).astype(np.uint8)

    shading, residual = frame.layer("shading"), frame.layer("residual")
    white = float(np.percentile(shading, 98))
    roughness = np.repeat(frame.layer("roughness")[..., None], 3, axis=-1)
    return rows(
        row(frame.colour, frame.layer("albedo"), roughness),
        row(shown(shading, white), shown(residual, white / 2), shown(frame.layer("shading_indoor"), white)),
    )  # fmt: skip


def class_map() -> Image.Image:
    frame = max(
        pf.open("out/coco/views"), key=lambda f: float((f.classes_by("mine.csv") > 0).mean())
    )
    mine = frame.classes_by("mine.csv")
    return row(frame.colour, blended(frame.colour, PALETTE[mine % len(PALETTE)], mine > 0))


def stereo() -> Image.Image:
    left, right = pf.open("out/walk/pairs")[:2]
    pixels = left.layer("disparity") / 256
    # Colours of 1 / disparity, which is proportional to depth.
    depth_mm = np.where(pixels > 0, 32_000 / np.maximum(pixels, 1e-6), 0).astype(np.uint16)
    return row(left.colour, right.colour, label_colours.depth_colours(depth_mm))


def plugin() -> Image.Image:
    frame = pf.open("out/height")[1]
    return row(frame.colour, label_colours.depth_colours(frame.layer("height"), 0.0, 2.5))


def blenderproc() -> Image.Image:
    import h5py

    with h5py.File(first("blenderproc/hdf5/*.hdf5", 1)) as file:
        depth = (1000 * file["depth"][:]).astype(np.uint16)
        normals = np.rint(255 * file["normals"][:]).astype(np.uint8)
        instances = label_colours.instance_colours(file["instance_segmaps"][:])
        upper = row(file["colors"][:], label_colours.depth_colours(depth))
        return rows(upper, row(normals, instances))


def coco() -> Image.Image:
    return row(*(_of_coco(n) for n in (0, 1)))


def _of_coco(n: int) -> Image.Image:
    from pycocotools import mask

    document = json.loads(first("coco/coco/*/annotations.json").read_text())
    folder = first("coco/coco/*/annotations.json").parent
    names = {c["id"]: c for c in document["categories"]}
    shown = document["images"][n]
    picture = np.asarray(Image.open(folder / shown["file_name"]).convert("RGB"))
    colours, where = picture.copy(), np.zeros(picture.shape[:2], bool)
    boxes = []
    for k, a in enumerate(a for a in document["annotations"] if a["image_id"] == shown["id"]):
        if names[a["category_id"]]["supercategory"] == "structure":
            continue
        visible = mask.decode(a["segmentation"]).astype(bool)
        colours[visible], where = PALETTE[k % len(PALETTE)], where | visible
        boxes.append((a["area"], a["bbox"], names[a["category_id"]]["name"], k))
    image = Image.fromarray(np.where(where[..., None], (picture // 2 + colours // 2), picture))
    draw = ImageDraw.Draw(image)
    for _area, (x, y, width, height), name, k in sorted(boxes, reverse=True)[:9]:
        colour = tuple(int(c) for c in PALETTE[k % len(PALETTE)])
        draw.rectangle((x, y, x + width, y + height), outline=colour)
        draw.text((x + 2, y + 1), name, fill="white", stroke_width=1, stroke_fill="black")
    return image


def questions() -> Image.Image:
    """A picture with the items of its phrases, and four of its questions."""
    folder = first("questions/rows/*/refs.json").parent
    refs = json.loads((folder / "refs.json").read_text())
    medium = refs[0]["file_name"]
    boxes = {
        a["id"]: a["bbox"]
        for a in json.loads((folder / "instances.json").read_text())["annotations"]
    }
    image = Image.open(folder / medium).convert("RGB").resize((WIDTH_PX, WIDTH_PX * 3 // 4))
    scale = WIDTH_PX / Image.open(folder / medium).width
    draw = ImageDraw.Draw(image)
    for k, ref in enumerate(r for r in refs if r["file_name"] == medium):
        x, y, width, height = (scale * v for v in boxes[ref["ann_id"]])
        colour = tuple(int(c) for c in PALETTE[k % len(PALETTE)])
        draw.rectangle((x, y, x + width, y + height), outline=colour)
        phrase = ref["sentences"][-1]["sent"]
        draw.text((x + 2, y + 1), phrase, fill="white", stroke_width=1, stroke_fill="black")
    questions = [json.loads(line) for line in (folder / "questions.jsonl").read_text().splitlines()]
    kinds = (
        "object_counting",
        "object_abs_distance",
        "object_rel_distance",
        "object_rel_direction_easy",
    )
    of_kind = {q["question_type"]: q for q in questions if q["media"] == medium}
    page = Image.new("RGB", (WIDTH_PX, 22 * len(kinds) + 8), "white")
    draw = ImageDraw.Draw(page)
    for k, question in enumerate(of_kind[kind] for kind in kinds if kind in of_kind):
        words = f"{question['question']}  {' '.join(question['options'] or ())}  -> {question['ground_truth']}"
        draw.text((6, 6 + 22 * k), words, fill="black")
    return rows(image, page)


def yolo() -> Image.Image:
    return row(*(_of_yolo(path) for path in sorted(OUT.glob("coco/yolo_seg/*/labels/*.txt"))[1:3]))


def _of_yolo(labels: Path) -> Image.Image:
    image = Image.open(labels.parents[1] / "images" / f"{labels.stem}.png").convert("RGB")
    draw = ImageDraw.Draw(image, "RGBA")
    for line in labels.read_text().splitlines():
        number, *shares = line.split()
        ring = np.array(shares, float).reshape(-1, 2) * image.size
        colour = tuple(int(c) for c in PALETTE[int(number) % len(PALETTE)])
        draw.polygon([tuple(p) for p in ring], fill=(*colour, 110), outline=(*colour, 255))
    return image


def hugging_face() -> Image.Image:
    from datasets import load_dataset

    views = load_dataset("out/parquet", split="train")
    return rows(*(_of_row(views[k]) for k in (0, 1)))


def _of_row(view: dict[str, Any]) -> Image.Image:
    colour, depth, normal, classes = (
        np.asarray(view[name]) for name in ("mlt_il_ol", "depth", "normal", "class40")
    )
    return row(
        colour, label_colours.depth_colours(depth.astype(np.uint16)), (normal // 257).astype(np.uint8),
        label_colours.semantic_colours(classes.astype(np.uint8)),
    )  # fmt: skip


def predict() -> Image.Image:
    photo = first("photos/*.png")
    return row(Image.open(photo), normals_of(first(f"train/seen/{photo.stem}_normal.png")))


def train() -> Image.Image:
    frame = pf.open("out/train/homes")[0]
    normals = first(f"viewseen/{frame.id.replace('/', '_')}_normal.png")
    truth = (frame.layer("normal") // 257).astype(np.uint8)
    return row(frame.colour, truth, normals_of(normals))


def normals_of(path: Path) -> Pixels:
    """The colours of a 16-bit picture of normals."""
    return (array_from_png(path.read_bytes()) // 257).astype(np.uint8)


def data_set() -> Image.Image:
    frames = pf.open("out/ten_thousand/set/parts/views")
    pictures = [frames[k].colour for k in range(8)]
    return rows(row(*pictures[:4]), row(*pictures[4:]))


def gpu() -> Image.Image:
    return row(*(pf.open(f"out/spp{n}")[0].colour for n in (4, 32, 256)))


def simulators() -> Image.Image:
    frames = pf.open("out/back")
    return row(frames[0].colour, frames[2].colour)


def own_furniture() -> Image.Image:
    frames = pf.open("out/ownviews")
    return row(frames[0].colour, frames[2].colour)


def cluster() -> Image.Image:
    return Image.open(OUT / "farm.png")


def estimate() -> Image.Image:
    return Image.open(OUT / "job.png")


def resume() -> Image.Image:
    """The stored sums of an interrupted view (out/resume_sums.npz), and the finished view."""
    sums, frame = np.load(OUT / "resume_sums.npz"), pf.open("out/resume")[0]
    house, view = frame.id.split("/")
    means = (
        sums[f"path/{name}"].reshape(frame.colour.shape) / np.float32(sums["path/spp"])
        for name in ("outdoor", "indoor", "albedo", "normal")
    )
    recipe = recipe_from_json((OUT / "resume/recipe.json").read_text(), "recipe.json")
    shown = develop(LinearAovs(*means), recipe.camera_of(house, view).tone, denoise=False)
    return row(shown["mlt_il_ol"].rgb_srgb8, frame.colour)


def photographs() -> None:
    """docs/pictures/photographs.jpg: two photographs, each beside a rendered view."""
    frames = pf.open("out/compare/desk")
    ours = [frames[1].colour, frames[2].colour]
    photos = [Image.open(path) for path in sorted(OUT.glob("photos/*.png"))]
    pairs = [row(photo, view) for photo, view in zip(photos, ours, strict=True)]
    rows(*pairs).save(PICTURES.parent / "photographs.jpg", quality=88, optimize=True)


def photographs_seen() -> None:
    """docs/pictures/photographs_seen.jpg: each photograph beside its normals, classes and edges."""
    outputs = ("seen", "classes", "edges")  # output folders of train.md's commands
    sheets = [
        row(
            Image.open(photo),
            *(Image.open(OUT / "train" / task / f"{photo.stem}_shown.png") for task in outputs),
        )
        for photo in sorted(OUT.glob("photos/*.png"))
    ]
    rows(*sheets).save(PICTURES.parent / "photographs_seen.jpg", quality=85, optimize=True)


def switches() -> None:
    """docs/pictures/switches.webp: a view's lights one after another."""
    frames = []
    for path in sorted(OUT.glob("light/*.png")):
        image = Image.open(path).convert("RGB")
        text = path.stem.partition("_")[2].replace("_", " ")
        draw = ImageDraw.Draw(image)
        draw.text((12, 332), text, fill="white", stroke_width=2, stroke_fill="black", font_size=20)
        frames.append(image)
    frames[0].save(
        PICTURES.parent / "switches.webp", save_all=True, append_images=frames[1:],
        duration=1400, loop=0, quality=80, method=6,
    )  # fmt: skip


PAGES: Final[dict[str, Callable[[], Image.Image]]] = {
    f.__name__: f
    for f in (
        own_camera, sun_and_hour, night, intrinsic, class_map, stereo, plugin, blenderproc, coco, questions, yolo, hugging_face,
        predict, train, data_set, gpu, simulators, own_furniture, cluster, estimate, resume,
    )
}  # fmt: skip


# Functions for other pages' pictures, which save their own files.
OTHERS: Final = {f.__name__: f for f in (switches, photographs, photographs_seen)}


def main(names: Iterable[str]) -> None:
    """Draw the named pictures, by default all."""
    for name in names or (*PAGES, *OTHERS):
        try:
            if name in OTHERS:
                OTHERS[name]()
            else:
                save(PAGES[name](), name)
        except (OSError, PbrsError) as error:
            print(f"{name}: {error}")


def save(image: Image.Image, name: str) -> None:
    """Save as a JPEG of at most MAX_BYTES."""
    PICTURES.mkdir(parents=True, exist_ok=True)
    path = PICTURES / f"{name}.jpg"
    for quality in range(90, 20, -5):
        image.convert("RGB").save(path, quality=quality, optimize=True)
        if path.stat().st_size <= MAX_BYTES:
            break
    print(
        f"{path}: {image.width}x{image.height}, {path.stat().st_size // 1000} kB, quality {quality}"
    )


if __name__ == "__main__":
    main(sys.argv[1:])
