"""Classes of nodes by name, for the naming habits of modelling programs and model shops."""

from __future__ import annotations

import pytest

from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.read.common.furniture_classes import PieceSize
from pbrs_farm.read.common.name_classes import class_of_node_name

# Node name, the materials it shows (optional), and the class or kind a person gives it.
NAMES_WITH_MATERIALS = """
AI37_008_lamp_002_11_Lamp_floor_0 | Lamp_floor | lamp
Bed_Bed_0 | material | bed
Brick_Facade001_Facade_0 | Facade | wall
canvas001_Canvas_1_0 | Canvas_1 | picture
carpet06-01_Carpet_in_LR_0 | Carpet_in_LR | floor mat
Celling_Celling_0 | Celling | ceiling
cgaxis_models_48_06_03_1_Chair_in_LR_0 | Chair_in_LR | chair
Comode_bedroom_Comode_0 | Comode | dresser
Comode_in_LR_Comode_in_LR_0 | Comode_in_LR | dresser
Couch_Couch_0 | Couch | sofa
Cut_exterior_wall_CUT_Walls_0 | CUT_Walls | wall
Domophone_Domophone_0 | Domophone | otherprop
Door_bedroom_Door_in_BR_0 | Door_in_BR | door
Entrance_door_Entrance_door_0 | Entrance_door | door
Floor_Wood_Floor_wood_0 | Floor_wood | floor
Lamp_thumb_Lmp_002_0 | Lmp_002 | lamp
Matrass_Matras_0 | Matras | bed
Picture_Picture_in_BR_0 | Picture_in_BR | picture
POT_Pot_0 | material_55 | otherprop
Sink_mirror_mirror_toilet_0 | mirror_toilet | mirror
Table_Table_Kitchen_0 | Table_Kitchen | table
Tile_floor_Floor_Ceramic_0 | Floor_Ceramic | floor
TV_1_TV_in_LR_0 | TV_in_LR | television
Vanna_Vanna_0 | Vanna | bathtub
Walls_Walls_0 | Walls | wall
Warderob_B_Warderobe_0 | Warderobe | cabinet
Washing_cupboard_Toilet_cupboard_0 | Toilet_cupboard | cabinet
bed_frame_bed_light_0 | bed_light | bed
bed_head_bedhead_light_0 | bedhead_light | bed
bed_head_bedhead_wood_0 | bedhead_wood | bed
leaves003_leaf_dining_table_0 | leaf_dining_table | plant
candle__candle_body_0 | candle_body | lamp
chopping_board_chopping_board1_0 | chopping_board1 | otherprop
jar_jar1_0 | jar1 | otherprop
painting_2nd_floor_painting_frame_grey_2nd_floor_0 | painting_frame_grey_2nd_floor | picture
refrigerator_refrigerator_handle_0 | refrigerator_handle | refrigerator
seat_1st_floor_seat_leg_1st_floor_0 | seat_leg_1st_floor | chair
sofahead_light_sofahead_light_0 | sofahead_light | lamp
bathroom_table_bathroom_table_0 | bathroom_table | table
bottle_bathroom_bottle_bathroom_0 | bottle_bathroom | otherprop
Carpet_1st_floor_Carpet_1st_floor_0 | Carpet_1st_floor | floor mat
dining_table_leg_dining_table_leg_0 | dining_table_leg | table
floor_2nd_floor_2nd_0 | floor_2nd | floor
heater_heater_0 | heater | otherfurniture
Bathroom_BackWall_0 | BackWall | wall
Bathroom_Cabinet_0 | Cabinet | cabinet
Bathroom_Light_0 | Light | lamp
Bathroom_MirrorLight_0 | MirrorLight | lamp
Bathroom_SideWalls_0 | SideWalls | wall
Bathroom_SkirtingBoard_0 | SkirtingBoard | otherstructure
Bathroom_Toilet_0 | Toilet | toilet
Bathroom_ToiletRug_0 | ToiletRug | floor mat
Tree_Tree_0 | Tree | plant
keyboard_blinn1_0 | blinn1 | otherprop
monitor2_blinn1_0 | blinn1 | television
grassland_grassland_0 | grassland | ground
bed_fireRed_material_0 | fireRed_material | bed
carpet_A_fireRed_material_0 | fireRed_material | floor mat
dresser_fireRed_material_0 | fireRed_material | dresser
stairs_fireRed_material_0 | fireRed_material | stairs
Bedroom_Carpet_0 | Carpet.002 | floor mat
"""
NAMES_OF_NODES = """
AC | baked | otherfurniture
sofa_bottom | sofa
Sofa003 | sofa
sofa_02_Seat | sofa
Mattres | bed
Bed_sheet_1 | otherprop
BedPillow01 | pillow
Bed_low | bed
Bed_Big_1 | bed
Dining_Table | table
Storage_rack | shelves
10057_wooden_door_v3_iterations-2 | door
chair_leg | chair
chair_1_seat | chair
monitor_screen | television
telescope_scope | otherprop
Computer_mouse | otherprop
Ceiling_Baked | ceiling
Ceiling_11 | ceiling
bar_wall001 | wall
Office_Desk028 | desk
Kitchen_Cabinets | cabinet
Island_Cabinets_ | cabinet
CeilingLamp4_1 | lamp
Environment_CanFridge | refrigerator
kitchen_chair_001 | chair
door_frame_001 | door
Window006 | window
Bedroom_Wall | wall
carpet_2_1_1 | floor mat
lamp_on | lamp
lamp_socket | lamp
lamp_cord | lamp
kitchenAppliances | otherfurniture
Chair_LOD1 | chair
TableMesh | table
Cabinet_Geo_01 | cabinet
SM_Office_wall01c | wall
SM_Stack_of_Books_2 | books
SM_Plant_Pot | otherprop
SM_Whiteboard_01 | whiteboard
SM_floor_01_28 | floor
SM_reception_01_2 | none
PointLight22 | lamp
Chair_mirror.001 | chair
Sofa.mirror | sofa
Handle_Mirror.003 | otherprop
Wall_mirror | mirror
Sink_mirror | mirror
Box001 | none
ChamferBox01 | none
Flower_bed | plant
River_bed | otherstructure
TableTopDecor | otherprop
BathtubBasin | bathtub
SinkBasin | sink
PaperTowelRoll | otherprop
towel_hook | otherprop
door_hinge | otherprop
"""
NAMES_OF_WOODS_AND_PLANTS = """
Table_Pine | table
Cabinet_Bamboo | cabinet
Floor_Maple | floor
Door_Leaf | door
Door_Leaf_01 | door
Table_Leaf | table
Bamboo_Floor | floor
Oak_Table | table
Pine_tree | plant
Wood_Pine_01 | none
Birch_Plywood | none
Chair_Rose | chair
Curtain_Rose | curtain
Flower_Vase | otherprop
Flower_Wallpaper | wall
Tree_House | otherprop
Grass | plant
Artificial_Grass_Mat | floor mat
Cushion_Leaf | pillow
Plant_Pot_01 | otherprop
"""
NAMES_WITH_PERSONS = """
Socket_Female | otherprop
Outlet_Male | otherprop
Baby_Crib | bed
Child_Bed | bed
Bed_Child | bed
Lazy_Boy | chair
Painting_Woman | picture
Picture_Girl | picture
Poster_Girl | picture
Girl_Bedroom | none
Bed_Bedroom | bed
Toilet_Bathroom_01 | toilet
Bed_Room | none
Boy_Room_Wall | wall
Woman_Sitting | person
Character_01 | person
Statue_Woman | otherprop
Bust_Man | otherprop
Snowman | otherprop
Toy_Man | otherprop
Worker_Desk | desk
Doll_Girl | otherprop
Mannequin | person
"""
NAMES_OF_REVIT = """
M_Chair-Breuer:M_Chair-Breuer:165479 | chair
M_Table-Dining Round w Chairs:0915mm Diameter:142000 | table
M_Table-Coffee:0610 x 0610 x 0610mm:143210 | table
M_Single-Flush:0915 x 2134mm:139000 | door
Single-Flush:36" x 84":136000 | door
Single Door:M_Single-Flush:900x2100mm | door
M_Double-Glass 1:1730 x 2134mm | door
Doors_IntSgl_1:Bedroom:150000 | door
Bifold-2 Panel:30" x 80":13 | door
Basic Wall:Wall-Ext_102Bwk-75Ins-100LBlk-12P:285330 | wall
Floor:Floor-Grnd-Susp_65Scr-80Ins-100Blk-75PC:286105 | floor
Basic Roof:Live Roof over Wood Joist Flat Roof:184483 | otherstructure
M_Sink Kitchen-Double:535x485 | sink
M_Tub-Rectangular-3D:M_Tub-Rectangular-3D | bathtub
M_Base Cabinet-Double Door & 2 Drawer:900mm | cabinet
M_Upper Cabinet-Double Door-Wall:900mm | cabinet
M_Sofa-Pensi:1650mm | sofa
M_Desk:1525 x 762mm | desk
M_Lighting Switches:Single Pole:Single Pole:575392 | otherprop
M_Downlight - Recessed Can:150mm | lamp
M_RPC Male:Alex:120 | person
M_Shelving:0915x0305 | shelves
M_Range:0762 | otherfurniture
Assembled Stair:Residential | stairs
M_Plant - Tropical:750 | plant
"""
NAMES_OF_PRIMS = """
FramePictureOval_1 | picture
ChairB_2 | chair
IronBoard_1 | otherfurniture
WallOrange_1 | wall
Refridgerator_1 | refrigerator
TableTop_grp | counter
PaperBagCrumpled_1 | bag
BottleMedicine_1 | otherprop
OvenMitt_1 | otherprop
GlassB_1 | otherprop
"""
NAMES_OF_PARTS_AND_PLACES = """
Door_Handle | otherprop
Cabinet_Door | cabinet
Wardrobe_Door_L | cabinet
Fridge_Door | refrigerator
Oven_Door | otherfurniture
Window_Sill | otherstructure
Window_Glass | window
Door_Glass | door
Mirror_Frame | mirror
Mirror_Glass | mirror
Bathroom_Mirror_Cabinet | cabinet
Bath_Mat | floor mat
Toilet_Paper | otherprop
Wall_Lamp | lamp
Wall_Art | picture
Floor_Vase | otherprop
Ceiling_Beam | otherstructure
Ground_Floor | floor
Lamp_Table | table
Bed_Side_Lamp | lamp
Light_Wood | none
Cabinet_Light_Oak | cabinet
Chair_Metal | chair
Table_Glass | table
Lamp_Glass | lamp
Shelf_Glass | shelves
Cabinet_Glass | cabinet
Glass_Table | table
Glass_Wall | wall
Table_Legs | table
Bed_Legs | bed
Sofa_Legs | sofa
Paper_Lamp | lamp
Wall_Paper | wall
Brick_Wall | wall
Floor_Tiles | floor
Kitchen_Wall_Tiles | wall
Kitchen_Floor | floor
Bathroom | none
LivingRoom_Floor.001 | floor
Cube.001 | none
Cylinder | none
Mesh_0045 | none
pCube3 | none
Light_Switch | otherprop
Pool_Table | otherfurniture
"""
NAMES = [
    tuple(cell.strip() for cell in row.split(" | "))
    for table in (
        NAMES_WITH_MATERIALS, NAMES_OF_NODES, NAMES_OF_WOODS_AND_PLANTS, NAMES_WITH_PERSONS,
        NAMES_OF_REVIT, NAMES_OF_PRIMS, NAMES_OF_PARTS_AND_PLACES,
    )
    for row in table.strip().splitlines()
]  # fmt: skip
KINDS = ("plant", "stairs", "person", "ground")


def class_of_name(name: str, *materials: str, size: PieceSize | None = None) -> str:
    result = class_of_node_name(name, materials=materials, size=size)
    if result is None:
        return "none"
    return result.kind.value if result.kind.value in KINDS else NYU40_NAMES[result.nyu40]


def test_a_name_is_read_with_its_materials_parts_places_and_suffixes() -> None:
    wrong = [
        f"{name}: {class_of_name(name, *materials)}, not {expected}"
        for name, *materials, expected in NAMES
        if class_of_name(name, *materials) != expected
    ]
    assert len(NAMES) > 200
    assert wrong == []


@pytest.mark.parametrize(
    ("name", "size", "expected"),
    [
        ("Pine", PieceSize(4.0, 2.4, 5.0), "none"),  # too large: all surfaces of that wood
        ("Pine", PieceSize(0.02, 2.0, 0.9), "none"),  # a board
        ("Pine", PieceSize(2.0, 5.0, 2.2), "plant"),
        ("Pine tree", PieceSize(4.0, 2.4, 5.0), "plant"),
        ("Grass", PieceSize(8.0, 0.02, 6.0), "ground"),
        ("Grass", PieceSize(0.4, 0.3, 0.4), "plant"),
        ("Bamboo_Floor", PieceSize(4.0, 0.02, 3.0), "floor"),
        ("Flower_Wallpaper", PieceSize(4.0, 2.4, 0.01), "wall"),
        ("Boy", PieceSize(6.0, 2.5, 8.0), "none"),
        ("Boy", PieceSize(0.5, 1.4, 0.3), "person"),
        ("Ceiling_connector", PieceSize(0.1, 0.04, 0.1), "none"),
        ("Ceiling", PieceSize(4.0, 0.04, 3.0), "ceiling"),
        # Size chooses between the words of a name; it never removes a class.
        ("bottle_dining_table", PieceSize(0.08, 0.3, 0.08), "otherprop"),
        ("bottle_dining_table", PieceSize(1.6, 0.8, 0.9), "table"),
        ("Sofa", PieceSize(0.3, 0.1, 0.1), "sofa"),
    ],
)
def test_its_size_decides_between_the_words_of_a_name(
    name: str, size: PieceSize, expected: str
) -> None:
    assert class_of_name(name, size=size) == expected
