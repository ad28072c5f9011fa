"""What goes wrong in a real laboratory: faults of a day, played where they really happen."""

from virtual_lab.simulation.faults.day import CATALOGUE, Day
from virtual_lab.simulation.faults.fault import Fault, Sound
from virtual_lab.simulation.faults.sheet import FaultSheet, Prediction

__all__ = ["CATALOGUE", "Day", "Fault", "FaultSheet", "Prediction", "Sound"]
