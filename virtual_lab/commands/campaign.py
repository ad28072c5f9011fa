"""Functions of the commands that read the folder of a campaign."""

from __future__ import annotations

from typing import Any

from virtual_lab import api
from virtual_lab.files.folders import CampaignFolder
from virtual_lab.output.progress import Progress, quiet


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
