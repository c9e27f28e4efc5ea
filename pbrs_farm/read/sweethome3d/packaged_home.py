"""Homes that name models of the program: those come from the Debian package of example homes.

Effects: reads the file, and the cached package; an example home is fetched through apt.
"""

from __future__ import annotations

from pbrs_farm.assets import homes_package
from pbrs_farm.assets.homes_package import Package
from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.common.format import GivenFile
from pbrs_farm.read.common.source_files import SourceFiles
from pbrs_farm.read.sweethome3d.home import read_home
from pbrs_farm.read.sweethome3d.home_file.container import needs_program
from pbrs_farm.regular_files import read_given


def read_packaged_home(given: GivenFile, fields: ReadFields) -> House:
    """The House of a home's file, with the program's own models where they are cached."""
    cached = homes_package.cached()
    resources = cached.resources() if cached else None
    data = read_given(given.path, error=BadHouse)
    return read_home(data, given.path.name, resources=resources, fields=fields)


def companions_of_home(given: GivenFile, _files: SourceFiles) -> str:
    """Digest of the package whose models the home names; "" for none, and for the tested version."""
    needs = needs_program(read_given(given.path, error=BadHouse), given.path.name)
    return package_digest(homes_package.cached()) if needs else ""


def read_example(name: str, fields: ReadFields) -> House:
    """The House of an example home. Raises MachineFailed where apt cannot give the package."""
    package = homes_package.fetch()
    data, file = package.home(name)
    return read_home(
        data,
        file,
        resources=package.resources(),
        fields=fields,
        package=package.label,
        package_note=package.note,
    )


def package_digest(package: Package | None) -> str:
    """Digest of the package of example homes and models; "" for the version tested with this release."""
    is_tested = package is not None and not package.note
    return "" if is_tested else keys.sha256((package.label if package else "none").encode())
