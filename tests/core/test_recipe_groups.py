"""Groups of the recipe: dependent steps, and a group added in two files."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from pbrs_farm.core import recipe
from pbrs_farm.core.recipe import groups_of_step, picture_groups
from pbrs_farm.prepare import passes
from pbrs_farm.run import plan

# A separate module, and one more line in recipe.py: its import and its field.
ADDED = """
import sys
from pathlib import Path
from types import ModuleType

import pbrs_farm.core
from pbrs_farm.core.recipe_fields import FieldGroup
from pydantic import Field


class FogFields(FieldGroup):
    '''Fog in rooms.'''

    steps = ("light",)

    density: float = Field(0.0, ge=0, le=1, description="per metre")


text = Path(sys.argv[1]).read_text()
line = "    blur: BlurFields = BlurFields()\\n"
assert line in text
module = ModuleType("pbrs_farm.core.recipe")
module.__file__, module.FogFields = sys.argv[1], FogFields
sys.modules[module.__name__] = pbrs_farm.core.recipe = module
field = line + "    fog: FogFields = FogFields()\\n"
exec(compile(text.replace(line, field), sys.argv[1], "exec"), module.__dict__)

from pbrs_farm.check.fact_checks import picture_groups
from pbrs_farm.cli import main
from pbrs_farm.run import plan

plain = module.recipe_from_name("fast")
foggy = module.recipe_from_name("fast", {"fog.density": "0.2"})


def digest(name, recipe):
    return plan.step_digest(plan.STEPS[name], recipe, "a", None, {})


assert foggy.fog.density == 0.2
assert digest("light", foggy) != digest("light", plain)
assert digest("truth", foggy) == digest("truth", plain)
assert "fog" in picture_groups()
assert main(["recipes"]) == 0
"""


@pytest.mark.kinds("recipe-group")
def test_a_group_is_added_in_its_module_and_the_recipe() -> None:
    words = [sys.executable, "-c", ADDED, str(recipe.__file__)]
    done = subprocess.run(words, capture_output=True, text=True, cwd=Path(__file__).parents[2])
    assert done.returncode == 0, done.stderr
    assert "fog.density = 0.0" in done.stdout
    assert "# per metre" in done.stdout


def test_every_step_of_a_group_exists_in_the_plan() -> None:
    names = {step for name, group in recipe.groups() for step in group.steps}
    assert names == set(plan.STEPS)
    assert set(passes.GROUPS) <= set(picture_groups())
    assert "selection" not in picture_groups()
    assert groups_of_step("light") == ("blur", "image", "light", "sky", "emission", "materials")
