"""Faults of a real laboratory, simulated where they occur: station, plan, specimen or record."""

from virtual_lab.simulation.faults.catalogue import CATALOGUE
from virtual_lab.simulation.faults.day import FaultSet, faults_at
from virtual_lab.simulation.faults.fault import Fault

__all__ = ["CATALOGUE", "Fault", "FaultSet", "faults_at"]
