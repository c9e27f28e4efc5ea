"""What a home's carpenters and fitters chose once for all rooms: doors, windows, stairs, boards, fittings."""

from pbrs_farm.dress.joinery.join_homes import joinery

__all__ = ["joinery"]
