"""Reading and writing of files: complete or not at all, with errors that name the file."""

from virtual_lab.files.documents import (
    check_new_folder,
    check_writable,
    contents,
    first_free,
    inside,
    new_files,
    new_folder,
    parse_json,
    parse_numbers,
    parse_table,
    parse_toml,
    read_bytes,
    read_json,
    read_table,
    read_text,
    read_toml,
    whole_file,
)
from virtual_lab.files.drafts import remove_drafts

__all__ = [
    "check_new_folder",
    "check_writable",
    "contents",
    "first_free",
    "inside",
    "new_files",
    "new_folder",
    "parse_json",
    "parse_numbers",
    "parse_table",
    "parse_toml",
    "read_bytes",
    "read_json",
    "read_table",
    "read_text",
    "read_toml",
    "remove_drafts",
    "whole_file",
]
