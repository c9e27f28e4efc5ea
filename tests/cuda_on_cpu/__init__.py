"""CUDA and OptiX without a GPU: the kernels that Dr.Jit makes for one, run on the CPU.

Dr.Jit opens the driver's libraries by name. Ours hold memory on the host, trace rays with Embree and
translate each kernel from PTX to C (ptx_to_c.py), so that all that a GPU would run is run, launch by
launch: the code of the kernels, what the host reads back, the tables of OptiX. Speed, occupancy and
the last bits of approximate instructions are not the GPU's.

    make test-cuda                                   the tests marked gpu
    python -m tests.cuda_on_cpu COMMAND [ARGUMENT...]   any command

Needs gcc on x86-64 Linux. A thread is a warp of its own: what only goes wrong between threads is not found.
"""
