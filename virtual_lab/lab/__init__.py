"""One test through both sides: rigs write the records, and the reduction reads them."""

from virtual_lab.lab.bat_test import BatTest, BlockTest
from virtual_lab.lab.certify import certify_bat, certify_block
from virtual_lab.lab.laboratory import Laboratory
from virtual_lab.lab.round_robin import RoundRobin
from virtual_lab.lab.setup import TestSetup
from virtual_lab.lab.test_day import TestDay, prepare_day, run_test

__all__ = [
    "BatTest",
    "BlockTest",
    "Laboratory",
    "RoundRobin",
    "TestDay",
    "TestSetup",
    "certify_bat",
    "certify_block",
    "prepare_day",
    "run_test",
]
