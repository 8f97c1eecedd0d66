"""How numbers are computed: compiled kernels, the records they read, threads, linear systems."""
