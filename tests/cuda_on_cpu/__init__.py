"""CUDA and OptiX without a GPU: Dr.Jit's kernels for a GPU, run on the CPU.

Dr.Jit opens the driver's libraries by name. Ours hold memory on the host, trace rays with Embree and
translate each kernel from PTX to C (ptx_to_c.py), so that everything runs launch by launch as on a
GPU: the code of the kernels, values read back by the host, the tables of OptiX. Speed, occupancy and
the last bits of approximate instructions differ from a GPU's.

    make test-cuda                                   the tests marked gpu
    python -m tests.cuda_on_cpu COMMAND [ARGUMENT...]   any command

Needs gcc on x86-64 Linux. Each thread is a separate warp: faults between threads are not found.
"""
