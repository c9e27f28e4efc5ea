"""Materials of furniture: wood, cloth, leather and metal where a source has plain colours."""

from pbrs_farm.dress.parts.finish_parts import parts

__all__ = ["parts"]
