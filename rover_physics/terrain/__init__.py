"""The ground: elevation maps, soils, and how kernels look heights up."""
