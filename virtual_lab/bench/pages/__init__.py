"""The pages of the rehearsal bench, which show a day and never the truth."""
