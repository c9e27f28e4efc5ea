"""Parts of a lamp that enclose its bulb become a translucent, never an invisible, shade; no effects."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from pbrs_farm.core.arrays import Bools
from pbrs_farm.core.house import House, Item, Material, MaterialKind, Surface
from pbrs_farm.core.recipe import RepairFields
from pbrs_farm.repair.lamps.light_output import (
    LampScene,
    LightOutput,
    lamp_scene_of_house,
    light_output_of_source,
)
from pbrs_farm.repair.measure.leaks import Occluder
from pbrs_farm.repair.repair_report import SourceRepair

_MOST_SHADES = 16  # of one lamp
_LEAST_BLOCKED = 0.02  # share of the light that makes a part worth opening


def with_shades(
    house: House,
    sources: Sequence[SourceRepair],
    fields: RepairFields,
    occluder_from: Callable[[House], Occluder],
) -> tuple[House, list[SourceRepair]]:
    """The light output ratio of every source; shades where it is below fields.min_light_output_ratio.

    The ratio is what share of a bulb's light leaves the lamp. sources: of `with_bulbs`, in whose
    report the ratios go. Only whole connected parts of a surface become shades; LightPart.escape
    carries the ratio afterwards.
    """
    scene = lamp_scene_of_house(house, occluder_from)
    shades, measured = _measure_sources(scene, fields)
    materials = list(house.materials)
    items: list[Item] = []
    names: dict[str, tuple[str, ...]] = {}  # item id -> surfaces that became shades
    for k, item in enumerate(house.items):
        # Split the shades of this lamp off its surfaces.
        mine = [scene.parts[p] for p in shades if scene.parts[p][0] == k]
        for j in sorted({part[1] for part in mine}):
            numbers = [part[2] for part in mine if part[1] == j]
            is_shade = np.isin(scene.labels[k, j], numbers)
            item = _split_off(item, j, is_shade, _shade_of(item.surfaces[j].material, materials))
            names[item.id] = (*names.get(item.id, ()), house.items[k].surfaces[j].name)
        lights = tuple(
            replace(light, escape=_rounded_ratio(measured[k, n][1].ratio))
            for n, light in enumerate(item.lights)
        )
        items.append(replace(item, lights=lights))

    # Add the ratios and the shades to the report of each source.
    index = {item.id: k for k, item in enumerate(house.items)}
    done = []
    for s in sources:
        before, after = (_rounded_ratio(x.ratio) for x in measured[index[s.item_id], s.source])
        shaded = {"escape_before": before, "escape": after, "shades": names.get(s.item_id, ())}
        done.append(s.model_copy(update=shaded))
    return replace(house, items=tuple(items), materials=tuple(materials)), done


def _measure_sources(
    scene: LampScene, fields: RepairFields
) -> tuple[list[int], dict[tuple[int, int], tuple[LightOutput, LightOutput]]]:
    """Parts that become shades; (item, source) -> its light output without and with them."""
    shades: list[int] = []
    measured: dict[tuple[int, int], tuple[LightOutput, LightOutput]] = {}
    for k, item in enumerate(scene.house.items):
        for source in range(len(item.lights)):
            before = light_output_of_source(scene, k, source, (), fields.shade_transmission)
            measured[k, source] = (before, _with_more_shades(scene, k, source, shades, fields))
    if shades:
        # Measure every source again: a shade may serve several of one lamp.
        measured = {
            key: (before, light_output_of_source(scene, *key, shades, fields.shade_transmission))
            for key, (before, _) in measured.items()
        }
    return shades, measured


def _with_more_shades(
    scene: LampScene, item: int, source: int, shades: list[int], fields: RepairFields
) -> LightOutput:
    """Add to shades the parts that stop most of this source's light, until enough gets out."""
    while True:
        output = light_output_of_source(scene, item, source, shades, fields.shade_transmission)
        # Stop once enough light escapes, or no part blocks much of the remainder.
        worst = int(np.argmax(output.blocked)) if len(output.blocked) else -1
        mine = sum(scene.parts[p][0] == item for p in shades)
        if output.ratio >= fields.min_light_output_ratio or mine >= _MOST_SHADES:
            return output
        if worst < 0 or output.blocked[worst] < _LEAST_BLOCKED:
            return output
        shades.append(worst)


def _shade_of(material: int, materials: list[Material]) -> int:
    """Index of the material as a shade, added at the end if it is not there yet."""
    shade = replace(
        materials[material], name=f"{materials[material].name}_shade", kind=MaterialKind.SHADE
    )
    if shade not in materials:
        materials.append(shade)
    return materials.index(shade)


def _split_off(item: Item, j: int, is_shade: Bools, material: int) -> Item:
    """The item with some faces of surface j as an appended surface, so that LightPart.emitting stays valid."""
    surfaces = list(item.surfaces)
    s: Surface = surfaces[j]
    if is_shade.all():
        surfaces[j] = replace(s, material=material)
    else:
        surfaces[j] = replace(s, faces=np.ascontiguousarray(s.faces[~is_shade]))
        faces = np.ascontiguousarray(s.faces[is_shade])
        surfaces.append(replace(s, name=f"{s.name}_shade", faces=faces, material=material))
    return replace(item, surfaces=tuple(surfaces))


def _rounded_ratio(value: float) -> float:
    return round(value, 5)
