"""The pages of the rehearsal bench, made from a day and never from the truth."""
