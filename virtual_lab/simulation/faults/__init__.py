"""Faults of a real laboratory, simulated at the place where they occur."""

from virtual_lab.simulation.faults.catalogue import CATALOGUE
from virtual_lab.simulation.faults.day import FaultSet
from virtual_lab.simulation.faults.fault import Fault

__all__ = ["CATALOGUE", "Fault", "FaultSet"]
