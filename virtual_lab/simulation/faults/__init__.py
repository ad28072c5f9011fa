"""What goes wrong in a real laboratory: faults of a day, played where they really happen."""

from virtual_lab.simulation.faults.day import CATALOGUE, FaultSet
from virtual_lab.simulation.faults.fault import BaseFault, Fault

__all__ = ["CATALOGUE", "BaseFault", "Fault", "FaultSet"]
