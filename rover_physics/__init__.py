"""The quasi-static model of a rocker-bogie rover on uneven ground: numpy in, dataclasses out."""

__version__ = "0.1.0"
