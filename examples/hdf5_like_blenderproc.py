"""Views as BlenderProc's HDF5: the same keys, conventions and camera poses."""

import sys

import pbrs_farm as pf

home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
pf.render(home, home.cameras(n=1), modes=["opengl_dl"]).save("out/hdf5/views")
print(pf.export_views("out/hdf5/views", "out/hdf5/files", "hdf5"))
