"""Campaigns: studies of many laboratories on disk, made part by part, by one worker or many."""

from virtual_lab.campaigns.account import Account
from virtual_lab.campaigns.folder import Campaign
from virtual_lab.campaigns.running import campaign
from virtual_lab.campaigns.study import Study

__all__ = ["Account", "Campaign", "Study", "campaign"]
