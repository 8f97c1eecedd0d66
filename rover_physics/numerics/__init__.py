"""How numbers are computed: kernels, their records, threads, linear systems, quaternions."""
