"""A home as a MuJoCo model, in the style of simulators' homes. Effects: writes files."""

from __future__ import annotations

from pathlib import Path

# A room of 4 x 3 m whose floor is an infinite plane, as in simulators.
ROOM = """
    <geom name="floor" type="plane" size="0 0 .01"/>
    <geom name="wall_n" type="box" pos="2 3.05 1.25" size="2.1 .05 1.25" rgba="1 0 0 1"/>
    <geom name="wall_s" type="box" pos="2 -.05 1.25" size="2.1 .05 1.25"/>
    <geom name="wall_w" type="box" pos="-.05 1.5 1.25" size=".05 1.5 1.25"/>
    <geom name="wall_e" type="box" pos="4.05 1.5 1.25" size=".05 1.5 1.25"/>
    <geom name="ceiling" type="box" pos="2 1.5 2.55" size="2.1 1.6 .05"/>"""
# A fridge whose door is hinged at its right front edge, and a drawer with a negative range.
THINGS = """
    <body name="fridge_1" pos="1 2.6 .9">
      <geom type="box" size=".3 .3 .9"/>
      <body name="fridge_1_door" pos=".3 -.3 0">
        <joint name="hinge" type="hinge" axis="0 0 1" range="0 2"/>
        <geom type="box" pos="-.3 -.02 0" size=".3 .02 .9"/>
        <geom type="box" pos="-.5 -.06 0" size=".02 .02 .3"/>
      </body>
    </body>
    <body name="cabinet" pos="3 1 .4" euler="0 0 1.5707963267948966">
      <geom type="box" size=".3 .2 .4"/>
      <body name="tray" pos="0 0 .1"><joint name="slide" type="slide" axis="0 1 0" range="-.25 0"/>
        <geom type="box" size=".25 .2 .05"/></body>
    </body>
    <body name="mug" pos="3 1 .85"><freejoint/><geom type="cylinder" size=".04 .05"/></body>"""


def write_model(
    folder: Path, world: str = ROOM + THINGS, more: str = "", name: str = "home.xml"
) -> Path:
    """Write the model of a home. world: its bodies; more: elements before them."""
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    head = '<mujoco><compiler angle="radian"/>'
    path.write_text(f"{head}{more}<worldbody>{world}</worldbody></mujoco>")
    return path
