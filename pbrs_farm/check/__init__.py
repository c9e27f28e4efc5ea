"""Verify finished folders from their stored files alone; reads files, shares no code with stages."""

from pbrs_farm.check.certificate import Certificate, Count
from pbrs_farm.check.verify import verify

__all__ = ["Certificate", "Count", "verify"]
