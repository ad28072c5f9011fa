"""What goes wrong in a real laboratory: faults of a day, played where they really happen."""

from virtual_lab.simulation.faults.catalogue import CATALOGUE
from virtual_lab.simulation.faults.day import FaultSet
from virtual_lab.simulation.faults.fault import Fault

__all__ = ["CATALOGUE", "Fault", "FaultSet"]
