"""How numbers are computed: kernels, the records they read, threads, linear systems, quaternions."""
