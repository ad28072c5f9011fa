"""The server of the pages: access control, and the actions of forms."""
