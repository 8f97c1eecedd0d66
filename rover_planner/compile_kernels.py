"""Compiles the model's kernels into their cache, so that what starts next need not."""

from rover_physics.sweep import warm_up

if __name__ == "__main__":
    warm_up()
