"""Functions of the commands that read the folder of a campaign."""

from __future__ import annotations

from typing import Any

from virtual_lab import api
from virtual_lab.files.folders import CampaignFolder
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.parameters import Address, Positive, Share


def resume(
    folder: CampaignFolder,
    *,
    workers: Positive = 1,
    blocks: Share | None = None,
    dask: Address | None = None,
    progress: Progress = quiet,
) -> Any:
    """Make the missing and damaged parts of a campaign.

    Finished parts stay. Study and data sheets are those in the folder. The exit code is 4 if a part
    is still missing after two attempts.

    Parameters
    ----------
    folder
        Folder of the campaign.
    workers
        Number of processes on this machine, each with one thread; 1 uses the current process.
    blocks
        Compute only share N of M of the campaign, for example ``3/40`` in a job array. By default
        all of it.
    dask
        Address of a Dask scheduler, for example ``tcp://lab:8786`` (needs the extra ``dask``). Its
        workers replace the processes on this machine. They must have access to the same folder.
    progress
        Function that is called with a message, the number of tests done, and the total.
    """
    return api.campaign(None, folder, workers=workers, blocks=blocks, dask=dask, progress=progress)


def check(folder: CampaignFolder, *, progress: Progress = quiet) -> Any:
    """List damaged and missing parts of a campaign.

    The exit code is 4 if there are any.
    """
    return api.Campaign.open(folder).check(progress)


def summary(folder: CampaignFolder) -> Any:
    """Show verdicts, means, errors and coverage of the tests of a campaign.

    The table has one row per combination of bat, procedure and changed settings.
    """
    return api.Campaign.open(folder).summary()
