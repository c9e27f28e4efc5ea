"""A home as URDF and as a world of SDF, written by hand: boxes, a cupboard that opens. Effects: writes files."""

from __future__ import annotations

from pathlib import Path

# link -> middle and size of its box, metres, z up
BOXES = {
    "floor": ((2, 1.5, -0.05), (4, 3, 0.1)),
    "ceiling": ((2, 1.5, 2.55), (4, 3, 0.1)),
    "wall_n": ((2, 3.05, 1.25), (4.2, 0.1, 2.5)),
    "wall_s": ((2, -0.05, 1.25), (4.2, 0.1, 2.5)),
    "wall_w": ((-0.05, 1.5, 1.25), (0.1, 3.2, 2.5)),
    "wall_e": ((4.05, 1.5, 1.25), (0.1, 3.2, 2.5)),
    "cabinet": ((1, 2.7, 0.9), (0.6, 0.6, 1.8)),
}
DOOR = (0.6, 0.02, 1.8)  # size; hinged at the cabinet's right front edge, opens to the room
HINGE = (0.3, -0.32, 0.0)  # from the cabinet's middle
RED = "0.8 0.1 0.1 1"


def _text(values: tuple[float, ...]) -> str:
    return " ".join(f"{x:g}" for x in values)


def write_urdf(folder: Path, more: str = "") -> Path:
    """The robot `home`; more: elements at its end."""
    rows = ['<robot name="home"><link name="world"/>']
    rows.append(f'<material name="red"><color rgba="{RED}"/></material>')
    for name, (middle, size) in BOXES.items():
        rows.append(
            f'<link name="{name}"><visual><geometry><box size="{_text(size)}"/></geometry></visual></link>'
            f'<joint name="{name}.at" type="fixed"><parent link="world"/><child link="{name}"/>'
            f'<origin xyz="{_text(middle)}"/></joint>'
        )
    rows.append(
        '<link name="cabinet_door"><visual><origin xyz="-0.3 0 0"/>'
        f'<geometry><box size="{_text(DOOR)}"/></geometry><material name="red"/></visual></link>'
        '<joint name="hinge" type="revolute"><parent link="cabinet"/><child link="cabinet_door"/>'
        f'<origin xyz="{_text(HINGE)}"/><axis xyz="0 0 1"/><limit lower="0" upper="1.5"/></joint>'
    )
    path = folder / "home.urdf"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join([*rows, more, "</robot>"]))
    return path


def write_sdf(folder: Path, more: str = "", is_included: bool = False) -> Path:
    """The world `home`; more: models at its end. is_included: the cabinet is a file of its own."""
    rows = ['<sdf version="1.9"><world name="home">']
    for name, (middle, size) in BOXES.items():
        inner = f'<link name="link"><visual name="v"><geometry><box><size>{_text(size)}</size></box></geometry></visual></link>'
        if name == "cabinet":
            inner += (
                f'<link name="door"><pose relative_to="hinge">-0.3 0 0 0 0 0</pose><visual name="v">'
                f"<geometry><box><size>{_text(DOOR)}</size></box></geometry>"
                f"<material><diffuse>{RED}</diffuse></material></visual></link>"
                f'<joint name="hinge" type="revolute"><pose relative_to="link">{_text(HINGE)} 0 0 0</pose>'
                "<parent>link</parent><child>door</child><axis><xyz>0 0 1</xyz>"
                "<limit><lower>0</lower><upper>1.5</upper></limit></axis></joint>"
            )
        place = f"<pose>{_text(middle)} 0 0 0</pose>"
        model = f'<model name="{name}">{place}{inner}</model>'
        if name == "cabinet" and is_included:
            file = folder / "models/cupboard/model.sdf"
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(f'<sdf version="1.9"><model name="other">{inner}</model></sdf>')
            uri = "<uri>model://cupboard</uri>"
            model = f"<include>{uri}<name>{name}</name>{place}</include>"
        rows.append(model)
    path = folder / "home.sdf"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join([*rows, more, "</world></sdf>"]))
    return path
