"""Where things can stand: horizontal faces of furniture with free space above, from raw meshes."""

from pbrs_farm.dress.supports.find_supports import Support, supports_of_item
from pbrs_farm.dress.supports.plan_grid import PlanGrid
from pbrs_farm.dress.supports.scene_triangles import SceneTriangles

__all__ = ["PlanGrid", "SceneTriangles", "Support", "supports_of_item"]
