"""Light: path tracing and Metropolis, denoising and tone; only here and in raycast mitsuba and drjit.

Effects: names LLVM's library to Dr.Jit, which modules below import as they are imported.
"""

from pbrs_farm.raycast.variant import name_libraries

name_libraries()
