"""`pbrs-farm export ROOT --to gltf | habitat | mjcf | sdf | urdf | usd`: homes as scenes of other simulators.

Effects: reads house.glb and house.json of an output folder, writes a new folder; it appears whole or not at all.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import House
from pbrs_farm.export.form import REMARKS, HomeForm, form_names, form_of, options_from
from pbrs_farm.export.grasps import GRASPS, grasps_json
from pbrs_farm.export.home_pieces import ExportedHome, exported_home
from pbrs_farm.formats.house_bundle import house_from_bundle
from pbrs_farm.regular_files import MAX_SCENE_BYTES, files_below, new_folder, read_given


def export_homes(folder: Path, out: Path, name: str, **options: Any) -> tuple[int, int, list[str]]:
    """Write every home of folder to out in the form of that name: (homes, files, remarks for the user).

    folder: an output folder, or one of `repair` or `dress` with house.glb. Each home gets a folder of its
    id. options: of the form. Raises BadInput for a form of views, an option that the form does not have,
    a folder without homes, or an out that is not empty.
    """
    form, remarks = _home_form(name), []
    form_options = options_from(form, options)
    folders = house_folders(folder)
    with new_folder(out) as scratch:
        for house_folder in folders:
            home = exported_home(stored_house(house_folder), form_options)
            _write_home(home, scratch / home.house.id, form)
            written = scratch / home.house.id / REMARKS
            if written.is_file():
                remarks += written.read_text("utf-8").splitlines()
            if form.remark:
                remarks.append(f"{home.house.id}: {form.remark}")
        return len(folders), len(files_below(scratch)), remarks


def export_house(house: House, out: Path, name: str, **options: Any) -> int:
    """Write one house to a new folder in the form of that name; returns the number of files.

    options: of the form. Raises BadInput as export_homes.
    """
    form = _home_form(name)
    home = exported_home(house, options_from(form, options))
    with new_folder(out) as scratch:
        _write_home(home, scratch, form)
        return len(files_below(scratch))


def _home_form(name: str) -> HomeForm:
    form = form_of(name) if name in form_names() else None
    if not isinstance(form, HomeForm):
        forms = (form_of(form_name) for form_name in form_names())
        hint = f"of {', '.join(form.name for form in forms if isinstance(form, HomeForm))}"
        raise BadInput("--to", name, "no such format of homes", hint=hint)
    return form


def _write_home(home: ExportedHome, folder: Path, form: HomeForm) -> None:
    folder.mkdir(exist_ok=True)
    form.write(home, folder)
    if form.up:
        (folder / GRASPS).write_bytes(grasps_json(home, form.up))
    if home.credit:
        (folder / "ATTRIBUTION.txt").write_text(f"{home.credit}\n", "utf-8")


def house_folders(folder: Path) -> list[Path]:
    """Folders with house.glb and house.json: folder itself, or the subfolders of its houses.

    Sorted by name. Raises BadInput if there are no such folders; a house without one of the files is
    left out.
    """
    below = folder / "houses"
    folders = sorted(below.iterdir()) if below.is_dir() else [folder]
    folders = [f for f in folders if (f / "house.glb").is_file() and (f / "house.json").is_file()]
    if not folders:
        hint = "an output folder of `run`, `dress` or `repair`"
        raise BadInput(folder, "", "has no house.glb and house.json", hint=hint)
    return folders


def stored_house(folder: Path) -> House:
    """The house of a folder's house.glb and house.json; needs no recipe or manifest.

    Raises BadInput if a file is damaged, not regular, or larger than the limit for scenes.
    """
    files = (folder / name for name in ("house.glb", "house.json"))
    return house_from_bundle(*(read_given(file, MAX_SCENE_BYTES) for file in files))
