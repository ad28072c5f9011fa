"""The server of the pages: who may come in, what a form does."""
