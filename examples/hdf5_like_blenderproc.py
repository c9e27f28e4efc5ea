"""Views as BlenderProc's HDF5: the same keys, conventions and camera poses."""

import sys
from pathlib import Path

import pbrs_farm as pf
from pbrs_farm.export.export_views import export

home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
pf.render(home, home.cameras(n=1), modes=["opengl_dl"]).save("out/hdf5/views")
print(export(Path("out/hdf5/views"), Path("out/hdf5/files"), "hdf5"))
