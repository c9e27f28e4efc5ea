"""Every generated small thing by name; no effects."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

import numpy as np

from pbrs_farm.dress.generated import bath, desk, floor_things, household, soft, tableware
from pbrs_farm.dress.generated.assembly import Made
from pbrs_farm.dress.style import Style

Generator = Callable[[np.random.Generator, Style], Made]

GENERATORS: Final[Mapping[str, Generator]] = {
    "bag": household.bag,
    "basket": household.basket,
    "bed_pillow": soft.bed_pillow,
    "bin": household.bin_,
    "binders": desk.magazine_file,
    "bottle": tableware.bottle,
    "bowl": tableware.bowl,
    "brush_cup": bath.brush_cup,
    "candle": household.candle,
    "carton": household.carton,
    "cartons": household.cartons,
    "clock": household.clock,
    "cup": tableware.cup,
    "cushion": soft.cushion,
    "folded_blanket": soft.folded_blanket,
    "folded_clothes": soft.folded_clothes,
    "folded_towels": soft.folded_towels,
    "fruit": tableware.fruit,
    "glass": tableware.glass_of_water,
    "jar": tableware.jar,
    "kettle": tableware.kettle,
    "kitchen_roll": soft.kitchen_roll,
    "laptop": desk.laptop,
    "laundry_basket": floor_things.laundry_basket,
    "mills": tableware.mills,
    "one_plate": tableware.one_plate,
    "notebook": desk.notebook,
    "ornament": household.ornament,
    "pan": tableware.pan,
    "papers": desk.papers,
    "pen_pot": desk.pen_pot,
    "phone": desk.phone,
    "plant_pot": household.plant_pot,
    "plates": tableware.plates,
    "pot": tableware.pot,
    "pouf": floor_things.pouf,
    "remote": desk.remote,
    "shelf_basket": household.shelf_basket,
    "shoes": household.shoes,
    "soap_bar": bath.soap_bar,
    "soap_dispenser": bath.soap_dispenser,
    "sponge": bath.sponge,
    "spray_bottle": bath.spray_bottle,
    "stool": floor_things.stool,
    "storage_box": household.storage_box,
    "suitcase": floor_things.suitcase,
    "table_frame": household.table_frame,
    "tissue_box": household.tissue_box,
    "toilet_rolls": soft.toilet_rolls,
    "toiletries": bath.toiletries,
    "vase": household.vase,
}
