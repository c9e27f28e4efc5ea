"""Forms of a set against the files of its parts; set_fields.csv lists the files of each check. Reads files."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pbrs_farm.check.cases import FormCase
from pbrs_farm.check.checks import Check
from pbrs_farm.check.form_truth import (
    Z_UP,
    FormTruth,
    camera_matrix,
    covisibility,
    mask_from_runs,
    metres_of_logarithms,
    wanted_matrix,
    whole_centres,
)
from pbrs_farm.check.plan import polygon_area
from pbrs_farm.check.rules import judge
from pbrs_farm.check.stored_files import stored_bytes, stored_object
from pbrs_farm.check.stored_set import MODES, PACKED
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.images import array_from_png, decode_photo, layers_from_exr

_FAR = 65535  # mm, and more
_FAR_IS_NOTHING = ("yolo-depth", "marigold", "openspatial", "lingbot")
_STRUCTURE = ("wall", "floor", "ceiling", "door", "window", "otherstructure")
_BESIDE = {
    "coco": ("form masks",), "yolo": ("form boxes",), "yolo-seg": ("form boxes",), "yolo-semantic": ("form masks",),
    "yolo-depth": ("form depth",), "marigold": ("form depth", "form normals"), "wai": ("form depth",),
    "openspatial": ("form depth", "form cameras"), "lingbot": ("form depth", "form cameras"),
    "nerfstudio": ("form depth", "form normals"), "moge": ("form depth", "form normals", "form cameras"),
}  # fmt: skip
"""Form -> checks of the files that every picture has beside it."""
_DOCUMENTS = {"coco": ("annotations.json", "panoptic.json"), "questions": ("instances.json",)}
_SUPER = {True: "object", False: "structure"}  # COCO's supercategories
_NO_BOX = ("wall", "floor", "ceiling")  # of YOLO
_LOSS = 8.0  # mean difference of a JPEG
_LENSES = {"pinhole": "PINHOLE", "radtan": "OPENCV", "fisheye": "OPENCV_FISHEYE", "equirect": "EQUIRECTANGULAR"}  # fmt: skip
_OUTLINE_PX = 2  # a polygon's corners keep within this of the mask


def check_pictures(case: FormCase) -> None:
    """Each view of the form is one that the index keeps in this split, and each picture is its view's."""
    shown = set[str]()
    expect = case.tally.at("form views", case.place())
    expect(bool(case.files), "is missing")
    for file, truth in _views_of(case, "form pictures"):
        shown.add(truth.view.place)
        mode = truth.mode(case.form.options.get("modes") or MODES)
        wanted = mode and truth.array(mode)
        if file.endswith(".jpg"):
            _check_photo(case, file, wanted)
        else:
            case.compare("form pictures", case.place(file), _array(case, file), wanted, 1)
    if shown:
        _expect_views(case, shown)
    if shown and not case.form.options.get("layers"):
        keys = {key for _file, key in case.matching("form pictures")}
        for check in _BESIDE.get(case.form.to, ()):
            fits = {key for _file, key in case.matching(check)} == keys
            expect(fits, f"has other views in the files of {check} than pictures")


def _check_photo(case: FormCase, file: str, wanted: Any) -> None:
    """A lossy picture is near the view's on the average."""
    stored = decode_photo(stored_bytes(case.folder / file), case.place(file)).astype(np.float64)
    fits = stored.shape == np.shape(wanted) and np.abs(stored - wanted).mean() <= _LOSS
    case.tally.expect("form pictures", case.place(file), fits, "is another picture")


def _views_of(case: FormCase, check: str) -> Iterator[tuple[str, FormTruth]]:
    """The files of a check with their views; a file of no view of the split fails."""
    for file, key in case.matching(check):
        view, fault = case.view(key), "is of no view that the index keeps here"
        case.tally.expect("form views", case.place(file), view is not None, fault)
        if view is not None:
            yield file, FormTruth(view, case.form.size)


def _expect_views(case: FormCase, shown: set[str]) -> None:
    """Every kept view with a picture is shown, and left_out.txt does not name it."""
    left_out = set[str]()
    if "left_out.txt" in case.files:
        lines = stored_bytes(case.folder / "left_out.txt").decode("utf-8", "replace").splitlines()
        left_out = {line.partition(":")[0] for line in lines}
    for view in filter(None, map(case.view, case.keys)):
        has_picture = FormTruth(view, None).mode(case.form.options.get("modes") or MODES)
        is_walk = case.form.to == "questions" and "frame" in view.table
        if has_picture and not is_walk:
            fits = view.place in shown and view.place not in left_out
            case.tally.expect("form views", case.place(), fits, f"lacks {view.place}")


def check_depth(case: FormCase) -> None:
    """Depth of each file, in its unit."""
    for file, truth in _views_of(case, "form depth"):
        place, depth = case.place(file), truth.label("depth.png")
        metres = truth.metres(case.form.options.get("layers") or ())
        if case.form.to == "moge":
            stored = metres_of_logarithms(stored_bytes(case.folder / file))
            sky = case.tally.at("form depth", place)
            sky(np.array_equal(np.isinf(stored), depth == 0), "has another sky")
            stored = np.where(depth > 0, stored, 0)
            case.compare("form depth", place, stored, metres, 1e-6 + 2e-4 * metres)
            continue
        if file.endswith(".exr") or (file.endswith(".npy") and truth.view.has("depth_z.exr")):
            wanted = metres
        else:
            is_far = (depth == _FAR) & (case.form.to in _FAR_IS_NOTHING)
            wanted = np.where(is_far, 0, depth)
        case.compare("form depth", place, _array(case, file), wanted, 1e-6)


def _array(case: FormCase, file: str) -> NDArray[Any]:
    """The array of a PNG, an .npy or an EXR's channel of the form."""
    data = stored_bytes(case.folder / file)
    if file.endswith(".exr"):
        return layers_from_exr(data, case.place(file))["Y"]
    if file.endswith(".npy"):
        return np.asarray(np.load(io.BytesIO(data), allow_pickle=False))
    return array_from_png(data, case.place(file))


def check_normals(case: FormCase) -> None:
    """Normals as stored, or as unit vectors in OpenGL's axes, 0 for nothing."""
    for file, truth in _views_of(case, "form normals"):
        name = "valid" if file.endswith("_valid.png") else "normal"
        stored = _array(case, file)
        wanted = truth.array(name) if case.form.to == "released" else truth.opengl_normals()
        if case.form.to in ("nerfstudio", "moge"):
            stored = np.where((stored > 0).any(-1, keepdims=True), stored * (2 / 65535) - 1, 0)
        case.compare("form normals", case.place(file), stored, wanted, 1e-4)


def check_segments(case: FormCase) -> None:
    """COCO's panoptic ids, YOLO's masks of classes, released classes and boundaries."""
    for file, truth in _views_of(case, "form masks"):
        stored = _array(case, file)
        if case.form.to == "released":
            wanted = truth.array("semantic" if file.startswith("category") else "boundary")
        elif case.form.to == "yolo-semantic":
            classes = truth.label("semantic.png").astype(int)
            wanted = np.where(classes > 0, classes - 1, 255)
        else:
            stored = stored.astype(int) @ [1, 256, 65536]
            is_known = np.isin(truth.instance, [row["id"] for row in truth.rows()])
            wanted = np.where(is_known, truth.instance, 0)
        case.compare("form masks", case.place(file), stored, wanted)


def check_text_boxes(case: FormCase) -> None:
    """YOLO's lines: a class and a box, or a polygon, as shares of the picture."""
    for file, truth in _views_of(case, "form boxes"):
        lines = stored_bytes(case.folder / file).decode("utf-8", "replace").splitlines()
        shapes = [(int(line.split()[0]), [float(x) for x in line.split()[1:]]) for line in lines]
        rows = [row for row in truth.rows() if row["class"] not in _NO_BOX]
        if case.form.to == "yolo-seg":
            _check_polygons(case, file, shapes, truth, rows)
            continue
        height, width = truth.shape
        boxes = []
        for row in rows:
            left, top, w, h = row["bbox"]
            box = (left + w / 2) / width, (top + h / 2) / height, w / width, h / height
            boxes.append((row["nyu40"] - 1, *box))
        stored = sorted((number, *box) for number, box in shapes)
        fits = np.shape(stored) == np.shape(boxes) and np.allclose(stored, sorted(boxes), atol=2e-6)
        fault = "has other boxes or classes than the instances of the view"
        case.tally.expect("form boxes", case.place(file), not rows or fits, fault)


def _check_polygons(
    case: FormCase,
    file: str,
    shapes: Sequence[tuple[int, list[float]]],
    truth: FormTruth,
    rows: list[dict[str, Any]],
) -> None:
    """The polygons of each class have the area of its pixels, and corners at their outline."""
    classes = {row["nyu40"] - 1 for row in rows}
    expect = case.tally.at("form boxes", case.place(file))
    expect({number for number, _corners in shapes} == classes, "has other classes than the view")
    for number in classes:
        mask = np.isin(truth.instance, [r["id"] for r in rows if r["nyu40"] - 1 == number])
        rings = [
            np.reshape(c, (-1, 2)) * np.array(mask.shape[::-1]) for k, c in shapes if k == number
        ]
        area = sum(map(polygon_area, rings))
        inner = ndimage.binary_erosion(mask)
        fits = abs(area - mask.sum()) <= (mask & ~inner).sum() + 4
        expect(fits, f"class {number} covers {area:.0f} px, in the view {mask.sum()}")
        near = ndimage.binary_dilation(mask, iterations=_OUTLINE_PX)
        corners = np.concatenate(rings or [np.zeros((0, 2))])
        columns, lines = np.clip(corners.astype(int), 0, np.array(mask.shape[::-1]) - 1).T
        expect(bool(near[lines, columns].all()), f"class {number} has corners off its pixels")


def check_coco(case: FormCase) -> None:
    """annotations.json and panoptic.json, and the instances of questions."""
    for file in _DOCUMENTS.get(case.form.to, ()):
        _Coco(case, file).check()


class _Coco:
    """A document of COCO's kind."""

    def __init__(self, case: FormCase, file: str) -> None:
        self.case, self.place, self.tally = case, case.place(file), case.tally
        self.is_panoptic = file == "panoptic.json"
        self.document = stored_object(case.folder / file)

    def check(self) -> None:
        self._check_classes()
        rows: dict[int, list[dict[str, Any]]] = {
            image["id"]: [] for image in self.document["images"]
        }
        for row in self.document["annotations"]:
            is_known = row["image_id"] in rows
            self.tally.expect("form boxes", self.place, is_known, f"has no image {row['image_id']}")
            rows.setdefault(row["image_id"], []).append(row)
        shown, houses = set[str](), set[Path]()
        for image in self.document["images"]:
            truth = self._truth(image)
            if truth is not None:
                shown.add(truth.view.place)
                houses.add(truth.view.folder.parents[1])
                self._check_rows(truth, rows[image["id"]])
        _expect_views(self.case, shown)
        ids = [row["id"] for row in self.document["annotations"] if not self.is_panoptic]
        fits = ids == list(range(1, len(ids) + 1))
        self.tally.expect("form boxes", self.place, fits, "numbers its annotations otherwise")
        if "licenses" in self.document:
            stored = {row["name"] for row in self.document["licenses"]}
            sources = [stored_object(house / "house.json")["source"] for house in sorted(houses)]
            fits = stored == {source.get("attribution") or "" for source in sources} - {""}
            self.tally.expect("form licences", self.place, fits, f"are {sorted(stored)}")

    def _check_classes(self) -> None:
        rows = {row["id"]: row for row in self.document["categories"]}
        wrong = [str(k) for k in rows if not 0 < k < len(NYU40_NAMES)]
        for k, name in enumerate(NYU40_NAMES[1:], 1):
            row, is_thing = rows.get(k, {}), name not in _STRUCTURE
            fits = row.get("name") == name and row["supercategory"] == _SUPER[is_thing]
            if not fits or row.get("isthing", is_thing) != is_thing:
                wrong.append(f"{k} {row.get('name')}")
        self.tally.expect("form classes", self.place, not wrong, f"has other classes: {wrong[:3]}")

    def _truth(self, image: dict[str, Any]) -> FormTruth | None:
        """The view of an image, which is checked; None for one that is not kept."""
        name = str(image.get("file_name", ""))
        is_of_coco = "house" in image
        key = f"{image['house']}__{image['view']}" if is_of_coco else Path(name).stem
        view = self.case.view(key)
        fault = f"has {key}, which the index does not keep here"
        self.tally.expect("form views", self.place, view is not None, fault)
        if view is None:
            return None
        truth = FormTruth(view, self.case.form.size)
        place = f"{self.place} {view.place}"
        judge("form size", place, self.tally, row=image, facts=truth.facts)
        if is_of_coco:
            judge("form camera", place, self.tally, row=image, facts=truth.facts)
        expected = f"images/{view.place}.png" if is_of_coco else f"pbrs_farm/{key}.png"
        self.tally.expect("form pictures", place, name in ("", expected), f"has the picture {name}")
        return truth

    def _check_rows(self, truth: FormTruth, rows: list[dict[str, Any]]) -> None:
        """The annotations of an image, or its row of segments."""
        place = f"{self.place} {truth.view.place}"
        if self.is_panoptic:
            fits = [row["file_name"] for row in rows] == [f"{truth.view.place}.png"]
            self.tally.expect("form masks", place, fits, "has other files of segments")
            rows = [s | {"instance_id": s["id"]} for row in rows for s in row["segments_info"]]
        expected = {row["id"]: row for row in truth.rows()}
        stored = sorted(row["instance_id"] for row in rows)
        fault = f"has the instances {stored}, not {sorted(expected)}"
        if not self.tally.expect("form boxes", place, stored == sorted(expected), fault):
            return
        for row in rows:
            of = f"{place} instance {row['instance_id']}"
            judge("form box", of, self.tally, row=row, truth=expected[row["instance_id"]])
            if not self.is_panoptic:
                judge("form instance", of, self.tally, row=row, truth=expected[row["instance_id"]])
                mask = mask_from_runs(row["segmentation"])
                fits = np.array_equal(mask, truth.instance == row["instance_id"])
                self.tally.expect("form masks", of, fits, "has another mask")


def check_class_names(case: FormCase) -> None:
    """The classes by number in data.yaml of YOLO, and its folders."""
    if not case.form.to.startswith("yolo"):
        return
    file = case.form.folder / "data.yaml"
    lines = stored_bytes(file).decode("utf-8", "replace").splitlines()
    expected = [f"  {k}: {name}" for k, name in enumerate(NYU40_NAMES[1:])]
    if case.form.to == "yolo-depth":
        expected = ["  0: depth"]
    expect = case.tally.at("form classes", f"forms/{case.form.name}/{case.form.part}/data.yaml")
    stored = [line for line in lines if line.startswith("  ")]
    expect(stored == expected, "has other classes")
    folder = f"{case.split}/images".lstrip("/")
    named = f"{case.split}: {folder}" if case.split else f"train: {folder}"
    expect(named in lines, f"lacks {named}")


def check_licences(case: FormCase) -> None:
    """licences.txt has the licences of every kept view, and no others than those of the part."""
    if case.form.to in PACKED:
        return
    file = case.form.folder / "licences.txt"
    stored = stored_bytes(file).decode("utf-8", "replace").splitlines() if file.is_file() else []
    expect = case.tally.at("form licences", f"forms/{case.form.name}/{case.form.part}/licences.txt")
    views = [view.table.get("licences", ()) for view in filter(None, map(case.view, case.keys))]
    wanted = {name for licences in views for name in licences}
    expect(wanted <= set(stored), f"lacks {', '.join(sorted(wanted - set(stored)))}")
    if not case.split:
        expect(stored == sorted(wanted), f"are {stored}, not {sorted(wanted)}")


def check_lists(case: FormCase) -> None:
    """Each line of Marigold's lists names files of one view, and every view is in the list of depth."""
    for file in case.files:
        if case.form.to == "marigold" and file.startswith("filename_list"):
            lines = stored_bytes(case.folder / file).decode("utf-8", "replace").splitlines()
            is_some = bool(case.form.options.get("layers"))
            n = sum(Path(other).name.startswith("rgb_") for other in case.files)
            fits = len(set(lines)) == len(lines) and (len(lines) == n or "iid" in file or is_some)
            case.tally.expect("form views", case.place(file), fits, f"lists {len(lines)} of {n}")
            for line in lines:
                names = line.split(" ")
                paths = [(Path(n).parent, Path(n).stem.partition("_")[2]) for n in names]
                fits = len(set(paths)) == 1 and set(names) <= set(case.files)
                case.tally.expect("form views", case.place(file), fits, f"pairs {line}")


def check_frames(case: FormCase) -> None:
    """nerfstudio's transforms.json: size, K, pose and files of each frame."""
    shown = set[str]()
    for file in case.files:
        if case.form.to != "nerfstudio" or not file.endswith("transforms.json"):
            continue
        house = file.partition("/")[0]
        document = stored_object(case.folder / file)
        for row in document["frames"]:
            place = f"{case.place(file)} {row['file_path']}"
            view = case.view(f"{house}__{Path(row['file_path']).stem}")
            case.tally.expect("form views", place, view is not None, "is of no kept view")
            if view is None:
                continue
            shown.add(view.place)
            facts = FormTruth(view, case.form.size).facts
            pose = (Z_UP @ np.array(facts["world_from_camera_opengl"])).tolist()
            lens = _LENSES[facts.get("lens", {}).get("model", "pinhole")]
            judge("form frame", place, case.tally, row=row, facts=facts, pose=pose)
            judge("form frames", place, case.tally, document=document, lens=lens, turn=Z_UP[:3].tolist(), override="none")  # fmt: skip
            for what, name in (("depth", "depth"), ("normals", "normal")):
                beside = Path(str(row.get(f"{name}_file_path", row["file_path"]))).name
                fits = beside == Path(row["file_path"]).name
                case.tally.expect(f"form {what}", place, fits, f"has the {what} {beside}")
    if case.form.to == "nerfstudio":
        _expect_views(case, shown)


def check_cameras(case: FormCase) -> None:
    """K and poses in separate files."""
    for file, truth in _views_of(case, "form cameras"):
        stored = camera_matrix(stored_bytes(case.folder / file))
        wanted = wanted_matrix(case.form.to, file, truth.facts)
        fits = stored.shape == wanted.shape and np.abs(stored - wanted).max() <= 1e-6
        case.tally.expect("form cameras", case.place(file), fits, "is another camera")


def check_wai(case: FormCase) -> None:
    """The frames of each scene of `wai`, and the share of each that others see."""
    shown = set[str]()
    for file in case.files:
        if case.form.to != "wai" or not file.endswith("/scene_meta.json"):
            continue
        house, document = file.partition("/")[0], stored_object(case.folder / file)
        truths: list[FormTruth] = []
        for row in document["frames"]:
            name, place = row["frame_name"], f"{case.place(file)} {row['frame_name']}"
            view = case.view(f"{house}__{name}")
            case.tally.expect("form views", place, view is not None, "is of no kept view")
            if view is None:
                continue
            shown.add(view.place)
            truths.append(FormTruth(view, case.form.size))
            facts = truths[-1].facts
            k = whole_centres(np.array(facts["K"], np.float64)).tolist()
            pose = facts["world_from_camera_opencv"]
            judge("form frame", place, case.tally, row=row, facts=facts | {"K": k}, pose=pose)
            names = row["image"], row["file_path"], row["depth"]
            fits = names == (f"images/{name}.png", f"images/{name}.png", f"depth/{name}.exr")
            case.tally.expect("form cameras", place, fits, "has the files of another view")
        kinds = [document[n] for n in ("camera_model", "camera_convention", "scale_type")]
        fits = kinds == ["PINHOLE", "opencv", "metric"]
        case.tally.expect("form cameras", case.place(file), fits, f"has cameras {kinds}")
        if len(truths) == len(document["frames"]):
            key = document["scene_modalities"]["pairwise_covisibility"]["scene_key"]
            _check_covisibility(case, f"{house}/{key}", truths)
    if case.form.to == "wai":
        _expect_views(case, shown)


def _check_covisibility(case: FormCase, file: str, truths: list[FormTruth]) -> None:
    """Rows of the matrix, within a thousandth; a point on a border may be on either side."""
    stored = np.asarray(_array(case, file))
    layers = case.form.options.get("layers") or ()
    expect = case.tally.at("form covisibility", case.place(file))
    if expect(stored.shape == (len(truths),) * 2, f"is {stored.shape} of {len(truths)} frames"):
        depths: list[F64] = [truth.metres(layers) for truth in truths]
        for row, shares in covisibility(truths, depths).items():
            off = float(np.abs(stored[row] - shares).max())
            expect(off <= 1e-3, f"row {row} is off by {off:.2g}")


CHECKS = (
    Check("form pictures", "form", check_pictures, 1),
    Check("form depth", "form", check_depth, 2),
    Check("form normals", "form", check_normals, 3),
    Check("form masks", "form", check_segments, 4, ("NYU40",)),
    Check("form boxes", "form", check_text_boxes, 5, ("NYU40",)),
    Check("coco", "form", check_coco, 6, ("NYU40",)),
    Check("form classes", "form", check_class_names, 7, ("NYU40",)),
    Check("form lists", "form", check_lists, 8),
    Check("form frames", "form", check_frames, 9),
    Check("form cameras", "form", check_cameras, 10),
    Check("form covisibility", "form", check_wai, 12),
    Check("form licences", "form", check_licences, 30),
)
